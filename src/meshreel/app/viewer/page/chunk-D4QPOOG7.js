var U=class{#e=new Map;addEventListener(e,t){let r=this.#e.get(e)??new Set;this.#e.set(e,r.add(t))}removeEventListener(e,t){this.#e.get(e)?.delete(t)}dispatchEvent(e){let t=this.#e.get(e.type)??[];for(let r of[...t])r({...e,target:this})}},M=class extends U{dispose(){this.dispatchEvent({type:"dispose"})}};var[Le,it]=[35044,35048],H=class{constructor(e,t){this.array=e;this.itemSize=t}array;itemSize;usage=Le;version=0;get count(){return this.array.length/this.itemSize}set needsUpdate(e){this.version++}setUsage(e){return this.usage=e,this}},V=class{constructor(e,t,r,n,i){this.buffer=e;this.type=t;this.itemSize=r;this.elementSize=n;this.count=i}buffer;type;itemSize;elementSize;count},W=class extends M{index=null;attributes={};groups=[];drawRange={start:0,count:1/0};boundingSphere=null;boundingBox=null;setIndex(e){this.index=e}getAttribute(e){return this.attributes[e]}setAttribute(e,t){this.attributes[e]=t}deleteAttribute(e){delete this.attributes[e]}addGroup(e,t,r){this.groups.push({start:e,count:t,materialIndex:r})}setDrawRange(e,t){this.drawRange={start:e,count:t}}setFromPoints(e){let t=Float32Array.from(e.flatMap(r=>r.toArray()));return this.setAttribute("position",new H(t,3)),this}};var A=class{constructor(e=0,t=0){this.x=e;this.y=t}x;y;set(e,t){return Object.assign(this,{x:e,y:t})}toArray(){return[this.x,this.y]}},p=class o{constructor(e=0,t=0,r=0){this.x=e;this.y=t;this.z=r}x;y;z;set(e,t,r){return[this.x,this.y,this.z]=[e,t,r],this}setScalar(e){return this.set(e,e,e)}setFromSphericalCoords(e,t,r){let n=e*Math.sin(t);return this.set(n*Math.sin(r),e*Math.cos(t),n*Math.cos(r))}copy({x:e,y:t,z:r}){return this.set(e,t,r)}clone(){return new o(this.x,this.y,this.z)}add(e){return this.addScaledVector(e,1)}sub(e){return this.addScaledVector(e,-1)}addScaledVector({x:e,y:t,z:r},n){return this.set(this.x+n*e,this.y+n*t,this.z+n*r)}subVectors(e,t){return this.copy(e).sub(t)}multiplyScalar(e){return this.set(this.x*e,this.y*e,this.z*e)}negate(){return this.multiplyScalar(-1)}min({x:e,y:t,z:r}){return this.set(Math.min(this.x,e),Math.min(this.y,t),Math.min(this.z,r))}max({x:e,y:t,z:r}){return this.set(Math.max(this.x,e),Math.max(this.y,t),Math.max(this.z,r))}dot({x:e,y:t,z:r}){return this.x*e+this.y*t+this.z*r}length(){return Math.hypot(this.x,this.y,this.z)}normalize(){return this.multiplyScalar(1/(this.length()||1))}distanceTo({x:e,y:t,z:r}){return Math.hypot(this.x-e,this.y-t,this.z-r)}cross(e){return this.crossVectors(this,e)}crossVectors(e,t){return this.set(e.y*t.z-e.z*t.y,e.z*t.x-e.x*t.z,e.x*t.y-e.y*t.x)}applyMatrix4({elements:e}){let{x:t,y:r,z:n}=this,i=s=>e[s]*t+e[s+4]*r+e[s+8]*n+e[s+12];return this.set(i(0),i(1),i(2))}fromArray(e,t=0){return this.set(e[t],e[t+1],e[t+2])}fromBufferAttribute({array:e},t){return this.fromArray(e,3*t)}toArray(e=[],t=0){return[e[t],e[t+1],e[t+2]]=[this.x,this.y,this.z],e}},J=class{#e=[0,0,0,0];set(...e){return this.#e=e,this}toArray(){return this.#e}},_=class o{elements;constructor(e=1,t=0,r=0,n=0,i=1,s=0,a=0,c=0,l=1){this.elements=[e,n,a,t,i,c,r,s,l]}copy({elements:e}){return this.elements=[...e],this}clone(){return new o().copy(this)}},b=class{elements=[1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1];copy({elements:e}){return this.elements=[...e],this}setAxes(...e){return this.elements=e.flatMap((t,r)=>[...t.toArray(),+(r===3)]),this}setPerspective(e,t,r,n){let[i,s]=[(n+r)/(r-n),2*n*r/(r-n)];return this.elements=[1/e,0,0,0,0,1/t,0,0,0,0,i,-1,0,0,s,0],this}setOrthographic(e,t,r,n){let[i,s]=[2/(r-n),(n+r)/(r-n)];return this.elements=[1/e,0,0,0,0,1/t,0,0,0,0,i,0,0,0,s,1],this}multiplyMatrices({elements:e},{elements:t}){return this.elements=t.map((r,n)=>{let i=n&12,s=0;for(let a=0;a<4;a++)s+=e[(n&3)+4*a]*t[i+a];return s}),this}copyInverse({elements:e}){let[t,r,n,i]=[0,4,8,12].map(m=>new p().fromArray(e,m)),s=[r.clone().cross(n),n.clone().cross(t),t.clone().cross(r)],a=1/(s[0].dot(t)||1),[c,l,d]=s.map(m=>m.multiplyScalar(a)),[h,u,f]=s.map(m=>-m.dot(i));return this.elements=[c.x,l.x,d.x,0,c.y,l.y,d.y,0,c.z,l.z,d.z,0,h,u,f,1],this}},ee=class{constructor(e=new p,t=-1){this.center=e;this.radius=t}center;radius;getBoundingBox(e){return e.min.copy(this.center).addScaledVector(new p(1,1,1),-this.radius),e.max.copy(this.center).addScaledVector(new p(1,1,1),this.radius),e}},te=class{min=new p;max=new p},E=class o{r=1;g=1;b=1;constructor(e=16777215,...t){t.length?this.setRGB(e,t[0],t[1]):this.set(e)}set(e){if(e instanceof o)return this.copy(e);let t=typeof e=="number"?e:we(e),[r,n,i]=[16,8,0].map(s=>Re((t>>s&255)/255));return this.setRGB(r,n,i)}setRGB(e,t,r){return Object.assign(this,{r:e,g:t,b:r})}copy({r:e,g:t,b:r}){return this.setRGB(e,t,r)}clone(){return new o().copy(this)}getHex(e){let[t,r,n]=this.toArray().map(i=>Math.min(Math.max(Math.round(255*Fe(i)),0),255));return t<<16|r<<8|n}toArray(){return[this.r,this.g,this.b]}};function we(o){let e=document.createElement("canvas").getContext("2d");e.fillStyle="white",e.fillStyle=o,e.fillRect(0,0,1,1);let[t,r,n]=e.getImageData(0,0,1,1).data;return t<<16|r<<8|n}function Re(o){return o<=.04045?o/12.92:((o+.055)/1.055)**2.4}function Fe(o){return o<=.0031308?o*12.92:1.055*o**(1/2.4)-.055}var se="srgb",[ut,dt,re]=[10497,33648,33071],[Ie,D,C]=[9728,9729,9987],[Ue,mt,_e,N]=[5121,5122,5125,5126],[ht,Ce,ft,pt]=[33319,6408,33320,36249],L=class o extends M{isTexture=!0;image;version=0;channel=0;colorSpace="";flipY=!0;generateMipmaps=!0;internalFormat=null;type=Ue;format=Ce;wrapS=re;wrapT=re;minFilter=C;magFilter=D;matrix=new _;matrixAutoUpdate=!0;repeat=new A(1,1);offset=new A;onUpdate=null;constructor(e=null){super(),this.image=e}set needsUpdate(e){this.version++}clone(){let e=new o(this.image),{flipY:t,colorSpace:r,wrapS:n,wrapT:i}=this;return Object.assign(e,{flipY:t,colorSpace:r,wrapS:n,wrapT:i})}updateMatrix(){let{repeat:e,offset:t,matrix:r}=this;this.matrixAutoUpdate&&r.copy(new _(e.x,0,t.x,0,e.y,t.y))}},ne=class extends L{version=1},S=class extends L{constructor(e,t,r,n){super({data:e,width:t,height:r,depth:n}),this.flipY=this.generateMipmaps=!1,this.minFilter=this.magFilter=Ie}},oe=class extends S{constructor(e,t,r,n){super(e,t,r,n)}},ie=class extends M{constructor(t,r,{depthBuffer:n=!0,...i}){super();this.width=t;this.height=r;if(this.texture=Object.assign(new S(null,t,r),{version:1},i),!n)return;let s={internalFormat:"DEPTH_COMPONENT24",format:6402,type:_e,version:1};this.depthTexture=Object.assign(new S(null,t,r),s)}width;height;texture;depthTexture=null;dispose(){super.dispose(),this.texture.dispose(),this.depthTexture?.dispose()}};var[Pe,O]=[0,2],vt="300 es",P=class extends M{name="";opacity=1;transparent=!1;premultipliedAlpha=!1;depthTest=!0;depthWrite=!0;alphaTest=0;side=Pe;vertexColors=!1;polygonOffset=!1;polygonOffsetFactor=0;polygonOffsetUnits=0;set needsUpdate(e){}},z=class extends P{vertexShader="";fragmentShader="";uniforms={};constructor(e){super(),Object.assign(this,e)}},ae=class extends P{color=new E;map=null;aoMap=null;aoMapIntensity=1;glsl="";constructor({color:e,...t}={}){super(),X(this.color,e),Object.assign(this,t)}},le=class extends P{color=new E;emissive=new E(0);roughness=1;metalness=0;normalScale=new A(1,1);aoMapIntensity=1;flatShading=!1;map=null;roughnessMap=null;metalnessMap=null;normalMap=null;aoMap=null;emissiveMap=null;constructor({color:e,emissive:t,...r}){super(),X(this.color,e),X(this.emissive,t),Object.assign(this,r)}};function X(o,e){e!==void 0&&o.set(e)}var w=class extends U{name="";visible=!0;castShadow=!1;frustumCulled=!0;renderOrder=0;parent=null;children=[];position=new p;scale=new p(1,1,1);axes=[new p(1,0,0),new p(0,1,0),new p(0,0,1)];matrixWorld=new b;add(...e){for(let t of e)t.removeFromParent(),t.parent=this,this.children.push(t);return this}removeFromParent(){let e=this.parent?.children??[];return this.parent&&e.splice(e.indexOf(this),1),this.parent=null,this}setRotationX(e){this.axes[1].set(0,Math.cos(e),Math.sin(e)),this.axes[2].set(0,-Math.sin(e),Math.cos(e))}updateMatrixWorld(){let e=this.scale.toArray(),[t,r,n]=this.axes.map((s,a)=>s.clone().multiplyScalar(e[a])),i=new b().setAxes(t,r,n,this.position);this.parent?this.matrixWorld.multiplyMatrices(this.parent.matrixWorld,i):this.matrixWorld.copy(i);for(let s of this.children)s.updateMatrixWorld()}getWorldPosition(e){for(let t=this;;t=t.parent)if(!t.parent)return t.updateMatrixWorld(),e.fromArray(this.matrixWorld.elements,12)}localToWorld(e){return e.applyMatrix4(this.matrixWorld)}worldToLocal(e){return e.applyMatrix4(new b().copyInverse(this.matrixWorld))}copy(e,t=!0){let{name:r,visible:n,castShadow:i,frustumCulled:s,renderOrder:a}=e;return Object.assign(this,{name:r,visible:n,castShadow:i,frustumCulled:s,renderOrder:a}),this.position.copy(e.position),this.scale.copy(e.scale),this.axes.forEach((c,l)=>c.copy(e.axes[l])),t&&this.add(...e.children.map(c=>c.clone())),this}clone(e=!0){return new this.constructor().copy(this,e)}},ce=class extends w{},ue=class extends w{environment=null;environmentIntensity=1;skyIntensity=0;keyIntensity=0},R=class extends w{constructor(t=new W,r=[]){super();this.geometry=t;this.material=r}geometry;material;type="Mesh";mode=4;onBeforeRender(t){}getVertexPosition(t,r){return r.fromBufferAttribute(this.geometry.attributes.position,t)}raycast(t,r){let{index:n,groups:i}=this.geometry,s=n?.array??[],a=i.length?i:[{start:0,count:s.length}],c=t.inSpaceOf(this.matrixWorld),l=[0,1,2].map(()=>new p);for(let{start:d,count:h,materialIndex:u=0}of a){let f=[this.material].flat()[u]?.side===O;for(let m=d;m<d+h;m+=3){l.forEach((T,I)=>this.getVertexPosition(s[m+I],T));let y=c.hit(l,f);if(y===null)continue;let x=this.localToWorld(c.at(y)),v={a:s[m],b:s[m+1],c:s[m+2]},g=t.origin.distanceTo(x);r.push({distance:g,point:x,face:v,faceIndex:m/3,object:this})}}}dispose(){this.dispatchEvent({type:"dispose"})}},de=class extends R{mode=0},me=class extends R{mode=1},$=class extends w{projectionMatrix=new b;up=new p(0,1,0);lookAt(e){let[t,r,n]=this.axes;n.subVectors(this.position,e).normalize(),t.crossVectors(this.up,n).normalize(),r.crossVectors(n,t)}},he=class extends ${fov=50;aspect=1;near=.1;far=2e3;get slope(){return Math.tan(this.fov*Math.PI/360)}updateProjectionMatrix(){let{slope:e,aspect:t,near:r,far:n}=this;this.projectionMatrix.setPerspective(e*t,e,r,n)}};var fe=class o{constructor(e,t){this.origin=e;this.direction=t}origin;direction;static fromCamera(e,t,r){let{slope:n,aspect:i,position:s}=r,[a,c,l]=r.axes,d=a.clone().multiplyScalar(e*n*i).addScaledVector(c,t*n);return new o(s.clone(),d.sub(l))}intersectObject(e){let t=[];return e.raycast(this,t),t.sort((r,n)=>r.distance-n.distance)}inSpaceOf(e){let t=new b().copyInverse(e),r=this.at(1).applyMatrix4(t),n=this.origin.clone().applyMatrix4(t);return new o(n,r.sub(n))}at(e){return this.origin.clone().addScaledVector(this.direction,e)}hit([e,t,r],n){let[i,s]=[t.clone().sub(e),r.clone().sub(e)],a=new p().crossVectors(this.direction,s),c=i.dot(a);if(!(n?c:c>0))return null;let l=this.origin.clone().sub(e),d=l.dot(a)/c,h=l.cross(i),u=this.direction.dot(h)/c,f=s.dot(h)/c;return d>=0&&u>=0&&d+u<=1&&f>=0?f:null}};var[Oe,Be,Ge]=[5126,5124,35670],[Ve,We,De,Ne,ze]=[35664,35665,35666,35675,35676],F=class{handle;attributes;#e;#t;constructor(e,t,r){this.#e=e;let n=this.handle=e.createProgram(),i=[t,r];i.forEach((c,l)=>{let d=e.createShader(l?e.FRAGMENT_SHADER:e.VERTEX_SHADER);e.shaderSource(d,`#version 300 es
${c}`),e.compileShader(d),e.attachShader(n,d),e.deleteShader(d)}),e.linkProgram(n),e.getProgramParameter(n,e.LINK_STATUS)||e.isContextLost()||console.error(`the driver rejects a shader: ${e.getProgramInfoLog(n)}`,...i);let a=c=>e.getProgramParameter(n,c)??0;this.#t=Array.from({length:a(e.ACTIVE_UNIFORMS)},(c,l)=>{let{name:d,type:h}=e.getActiveUniform(n,l);return{name:d,type:h,unit:l,location:e.getUniformLocation(n,d)}}),this.attributes=Array.from({length:a(e.ACTIVE_ATTRIBUTES)},(c,l)=>{let{name:d}=e.getActiveAttrib(n,l);return[d,e.getAttribLocation(n,d)]})}use(e,t){let r=this.#e;r.useProgram(this.handle);for(let{name:n,type:i,location:s,unit:a}of this.#t){let c=e[n],l=()=>c.elements??c.toArray?.()??c;i===Oe?r.uniform1f(s,c):i===Be||i===Ge?r.uniform1i(s,c):i===Ne?r.uniformMatrix3fv(s,!1,l()):i===ze?r.uniformMatrix4fv(s,!1,l()):i===Ve?r.uniform2fv(s,l()):i===We?r.uniform3fv(s,l()):i===De?r.uniform4fv(s,l()):(t(c,a),r.uniform1i(s,a))}}},j=class{#e;#t=new Map;#r=new WeakMap;constructor(e){this.#e=e}get(e,t,r){let n=this.#t.get(t);n||this.#t.set(t,n={program:new F(this.#e,...r()),nUsers:0});let i=this.#r.get(e);return i||(this.#r.set(e,i=new Set),e.addEventListener("dispose",()=>this.#n(e))),i.has(t)||n.nUsers++,i.add(t),n.program}#n(e){for(let t of this.#r.get(e)??[]){let r=this.#t.get(t);!r||--r.nUsers||(this.#e.deleteProgram(r.program.handle),this.#t.delete(t))}this.#r.get(e)?.clear()}};var[je,ke]=[256,8],q=16,He=[{right:[0,0,-1],up:[0,-1,0],forward:[1,0,0]},{right:[0,0,1],up:[0,-1,0],forward:[-1,0,0]},{right:[1,0,0],up:[0,0,1],forward:[0,1,0]},{right:[1,0,0],up:[0,0,-1],forward:[0,-1,0]},{right:[1,0,0],up:[0,-1,0],forward:[0,0,1]},{right:[-1,0,0],up:[0,-1,0],forward:[0,0,-1]}],pe=`
out vec2 at;
void main() {
  at = vec2(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0);
  gl_Position = vec4(at, 0.0, 1.0);
}`,K=`
precision highp float;
precision highp samplerCube;
#define PI 3.141592653589793
#define N_SAMPLES 256u
in vec2 at;
out vec4 result;
uniform vec3 right;
uniform vec3 up;
uniform vec3 forward;
uniform float roughness;
uniform float lodBias;
uniform sampler2D panorama;
uniform samplerCube source;

vec2 sampleAt(uint i) {
  uint bits = (i << 16u) | (i >> 16u);
  bits = ((bits & 0x55555555u) << 1u) | ((bits & 0xAAAAAAAAu) >> 1u);
  bits = ((bits & 0x33333333u) << 2u) | ((bits & 0xCCCCCCCCu) >> 2u);
  bits = ((bits & 0x0F0F0F0Fu) << 4u) | ((bits & 0xF0F0F0F0u) >> 4u);
  bits = ((bits & 0x00FF00FFu) << 8u) | ((bits & 0xFF00FF00u) >> 8u);
  return vec2(float(i) / float(N_SAMPLES), float(bits) * 2.3283064365386963e-10);
}`,Xe=`${K}
vec3 colorAt(vec3 direction) {
  vec3 d = normalize(direction);
  vec2 place = vec2(atan(d.z, d.x) / (2.0 * PI), asin(clamp(d.y, -1.0, 1.0)) / PI) + 0.5;
  return textureLod(panorama, place, 0.0).rgb;
}
void main() {
  vec3 direction = normalize(right * at.x + up * at.y + forward);
  vec3 dx = dFdx(direction) * 0.25;
  vec3 dy = dFdy(direction) * 0.25;
  result = vec4(colorAt(direction - dx - dy) + colorAt(direction + dx - dy)
    + colorAt(direction - dx + dy) + colorAt(direction + dx + dy), 4.0) * 0.25;
}`,$e=`${K}
void main() {
  vec3 n = normalize(right * at.x + up * at.y + forward);
  if (roughness == 0.0) {
    result = textureLod(source, n, 0.0);
    return;
  }
  float alpha = roughness * roughness;
  float alpha2 = alpha * alpha;
  vec3 t = normalize(cross(abs(n.z) < 0.999 ? vec3(0.0, 0.0, 1.0) : vec3(1.0, 0.0, 0.0), n));
  vec3 b = cross(n, t);
  result = vec4(0.0);
  for (uint i = 0u; i < N_SAMPLES; i++) {
    vec2 xi = sampleAt(i);
    float scale = 1.0 / (1.0 - xi.x + alpha2 * xi.x);
    float nl = (1.0 - xi.x - alpha2 * xi.x) * scale;
    if (nl <= 0.0) continue;
    float side = 2.0 * alpha * sqrt(xi.x * (1.0 - xi.x)) * scale;
    vec3 l = n * nl + (t * cos(2.0 * PI * xi.y) + b * sin(2.0 * PI * xi.y)) * side;
    result += vec4(textureLod(source, l, max(log2(alpha2 * scale) + lodBias, 0.0)).rgb, 1.0) * nl;
  }
  result /= result.a;
}`,qe=`${K}
void main() {
  vec2 place = at * 0.5 + 0.5;
  float alpha2 = pow(place.x, 4.0);
  vec3 v = vec3(sqrt(1.0 - place.y * place.y), 0.0, place.y);
  vec2 sum = vec2(0.0);
  for (uint i = 0u; i < N_SAMPLES; i++) {
    vec2 xi = sampleAt(i);
    float nh = sqrt((1.0 - xi.x) / (1.0 + (alpha2 - 1.0) * xi.x));
    float side = sqrt(1.0 - nh * nh);
    vec3 h = vec3(side * cos(2.0 * PI * xi.y), side * sin(2.0 * PI * xi.y), nh);
    float vh = max(dot(v, h), 0.0);
    float nl = 2.0 * vh * h.z - v.z;
    if (nl <= 0.0) continue;
    float toViewer = nl * sqrt(alpha2 + (1.0 - alpha2) * v.z * v.z);
    float toLight = v.z * sqrt(alpha2 + (1.0 - alpha2) * nl * nl);
    float weight = 2.0 * nl * vh / ((toViewer + toLight) * nh);
    float fresnel = pow(1.0 - vh, 5.0);
    sum += vec2(1.0 - fresnel, fresnel) * weight;
  }
  result = vec4(sum / float(N_SAMPLES), 0.0, 1.0);
}`;function xe(o,e,t){let{width:r}=t.image,n=Math.max(Math.floor(Math.log2(r/4)),Math.log2(je)),i=n-Math.log2(ke),s=2**n,[a,c]=[n,i].map(u=>{let f=new L;return e.bindNew(f,o.TEXTURE_CUBE_MAP),o.texStorage2D(o.TEXTURE_CUBE_MAP,u+1,o.RGBA16F,s,s),o.texParameteri(o.TEXTURE_CUBE_MAP,o.TEXTURE_MIN_FILTER,C),o.texParameteri(o.TEXTURE_CUBE_MAP,o.TEXTURE_MAG_FILTER,D),f}),l=(u,f,m,y)=>{He.forEach((x,v)=>{ye(o,e,f,o.TEXTURE_CUBE_MAP_POSITIVE_X+v,m,s>>m,()=>{u.use({panorama:t,source:a,...x,...y},(g,T)=>e.bind(g,T))})})},[d,h]=[Xe,$e].map(u=>new F(o,pe,u));l(d,a,0,{}),e.bind(a),o.generateMipmap(o.TEXTURE_CUBE_MAP);for(let u=0;u<=i;u++){let f=1-Math.sqrt(1-u/i),m=n+.5*Math.log2(6/(256*f**4))+.5;l(h,c,u,{roughness:f,lodBias:f?m:0})}for(let u of[d,h])o.deleteProgram(u.handle);return a.dispose(),{texture:c,maxLod:i}}function be(o,e){let t=new S(null,q,q);t.minFilter=t.magFilter=D,Object.assign(t,{type:N,internalFormat:"RGBA16F",version:1}),e.bind(t);let r=new F(o,pe,qe);return ye(o,e,t,o.TEXTURE_2D,0,q,()=>r.use({},()=>{})),o.deleteProgram(r.handle),t}function ye(o,e,t,r,n,i,s){let a=o.createFramebuffer();o.bindFramebuffer(o.FRAMEBUFFER,a);let c=e.handleOf(t);o.framebufferTexture2D(o.FRAMEBUFFER,o.COLOR_ATTACHMENT0,r,c,n),o.viewport(0,0,i,i);for(let l of[o.DEPTH_TEST,o.BLEND,o.CULL_FACE,o.SCISSOR_TEST])o.disable(l);s(),o.drawArrays(o.TRIANGLES,0,3),o.deleteFramebuffer(a)}var k=class{#e;#t;#r=new WeakMap;#n=new WeakMap;#i=new WeakMap;constructor(e){this.#e=e,this.#t=e.getParameter(e.MAX_TEXTURE_SIZE),e.pixelStorei(e.UNPACK_COLORSPACE_CONVERSION_WEBGL,e.NONE)}bind(e,t=0){let r=this.#e;if(r.activeTexture(r.TEXTURE0+t),!e)return;let n=this.#r.get(e)??this.#l(e)??this.#o(e);r.bindTexture(n.target,n.handle),n.version!==e.version&&(n.version=e.version,this.#a(e,n.target))}handleOf(e){return this.#r.get(e)?.handle}bindNew(e,t){this.#o(e,t),this.bind(e)}#o(e,t){t??=ve(e).depth?this.#e.TEXTURE_2D_ARRAY:this.#e.TEXTURE_2D;let r={handle:this.#e.createTexture(),target:t,version:0,nUsers:1};return this.#s(e,r),r}framebuffer(e){let t=this.#e,r=this.#i.get(e);if(r)return r;this.#i.set(e,r=t.createFramebuffer());for(let i of[e.texture,e.depthTexture])i&&this.bind(i);t.bindFramebuffer(t.FRAMEBUFFER,r);let n=(i,s)=>{let a=i&&(this.handleOf(i)??null);a&&t.framebufferTexture2D(t.FRAMEBUFFER,s,t.TEXTURE_2D,a,0)};return n(e.texture,t.COLOR_ATTACHMENT0),n(e.depthTexture,t.DEPTH_ATTACHMENT),B(e,()=>{t.deleteFramebuffer(r),this.#i.delete(e)}),r}#s(e,t){this.#r.set(e,t),B(e,()=>{this.#r.delete(e),--t.nUsers===0&&this.#e.deleteTexture(t.handle)})}#l(e){let{image:t,colorSpace:r,wrapS:n,wrapT:i,version:s}=e;if(!(t instanceof ImageBitmap))return null;let a=this.#n.get(t)??new Map;this.#n.set(t,a);let c=`${r} ${n} ${i}`,l=a.get(c);if(!l?.nUsers){let d=this.#o(e);return a.set(c,d),d}return l.nUsers++,l.version=s,this.#s(e,l),l}#a(e,t){let r=this.#e,{format:n,type:i,flipY:s,generateMipmaps:a,minFilter:c}=e,l=e.colorSpace===se?"SRGB8_ALPHA8":"RGBA8",d=e.internalFormat??(i===N?"RGBA32F":l),h=r[d];r.pixelStorei(r.UNPACK_FLIP_Y_WEBGL,s);let{data:u,width:f,height:m,depth:y}=ve(e);u===void 0?r.texImage2D(t,0,h,n,i,this.#c(e.image)):y?r.texImage3D(t,0,h,f,m,y,0,n,i,u):r.texImage2D(t,0,h,f,m,0,n,i,u),r.pixelStorei(r.UNPACK_FLIP_Y_WEBGL,!1);let x=(v,g)=>r.texParameteri(t,v,g);x(r.TEXTURE_WRAP_S,e.wrapS),x(r.TEXTURE_WRAP_T,e.wrapT),x(r.TEXTURE_MAG_FILTER,e.magFilter),x(r.TEXTURE_MIN_FILTER,c),a&&c===C&&r.generateMipmap(t),e.onUpdate?.()}#c(e){let t=this.#t/Math.max(e.width,e.height);if(!(t<1))return e;let r=document.createElement("canvas");[r.width,r.height]=[Math.floor(e.width*t),Math.floor(e.height*t)],r.getContext("2d")?.drawImage(e,0,0,r.width,r.height);let n=`${e.width} x ${e.height}`;return console.warn(`a texture of ${n} pixels is scaled down to the limit of the GPU, ${this.#t}`),r}};function ve(o){return o.image}function B(o,e){let t=()=>{o.removeEventListener("dispose",t),e()};o.addEventListener("dispose",t)}var Y=["map","roughnessMap","metalnessMap","normalMap","aoMap","emissiveMap"],ge=new E(9080728),Ke=`
vec3 toSrgb(vec3 light) {
  vec3 isDark = vec3(lessThanEqual(light, vec3(0.0031308)));
  return mix(pow(light, vec3(0.41666)) * 1.055 - 0.055, light * 12.92, isDark);
}`,Ye=`
precision highp float;
uniform mat4 modelViewMatrix;
uniform mat4 projectionMatrix;
in vec3 position;
in vec3 normal;
in vec4 color;
out vec3 place;
out vec3 bent;
out vec4 tint;
IN_OUT
void main() {
  vec4 seen = modelViewMatrix * vec4(position, 1.0);
  place = seen.xyz;
  bent = mat3(modelViewMatrix) * normal;
#ifdef COLOR
  tint = color;
#endif
  UVS
  gl_Position = projectionMatrix * seen;
}`,Ze=`
precision highp float;
#define PI 3.141592653589793
uniform vec3 diffuse;
uniform float opacity;
uniform float alphaTest;
uniform float aoMapIntensity;
in vec3 place;
in vec3 bent;
in vec4 tint;
out vec4 shown;
IN_OUT
${Ke}
vec4 baseColor() {
  vec4 base = vec4(diffuse, opacity);
#ifdef MAP
  base *= texture(map, mapUv);
#endif
#ifdef COLOR
  base *= tint;
#endif
#ifdef ALPHA_TEST
  if (base.a < alphaTest) discard;
#endif
#ifdef OPAQUE
  base.a = 1.0;
#endif
  return base;
}
float occlusion() {
#ifdef AOMAP
  return (texture(aoMap, aoMapUv).r - 1.0) * aoMapIntensity + 1.0;
#else
  return 1.0;
#endif
}`,Qe="void main() { shown = baseColor(); }",Je=`
void main() {
  vec4 base = baseColor();
  vec3 light = base.rgb * occlusion();
  GLSL
  shown = vec4(toSrgb(light), base.a);
}`,et=`
uniform mat4 viewMatrix;
uniform vec3 emissive;
uniform float roughness;
uniform float metalness;
uniform vec2 normalScale;
uniform sampler2D dfgTable;
uniform float keyIntensity;
uniform float skyIntensity;
uniform vec3 groundColor;
uniform samplerCube environment;
uniform float environmentIntensity;
uniform float maxLod;

float pow2(float x) { return x * x; }
float saturate(float x) { return clamp(x, 0.0, 1.0); }

// Single and multiple scattering of a light from all directions.
void scatter(vec2 dfg, vec3 f0, out vec3 single, out vec3 multi) {
  single = f0 * dfg.x + dfg.y;
  float rest = 1.0 - dfg.x - dfg.y;
  vec3 mean = f0 + (1.0 - f0) / 21.0;
  multi = single * mean / (1.0 - rest * mean) * rest;
}

void main() {
  vec4 base = baseColor();
  float face = gl_FrontFacing ? 1.0 : -1.0;
#ifdef FLAT
  vec3 n = normalize(cross(dFdx(place), dFdy(place)));
#else
  vec3 n = normalize(bent);
  #ifdef DOUBLE
  n *= face;
  #endif
#endif
  vec3 change = max(abs(dFdx(n)), abs(dFdy(n)));
#ifdef NORMALMAP
  // The directions of u and v on the surface; see http://www.thetenthplanet.de/archives/1180
  vec3 across = cross(dFdy(place), n);
  vec3 along = cross(n, dFdx(place));
  vec2 du = dFdx(normalMapUv);
  vec2 dv = dFdy(normalMapUv);
  vec3 t = across * du.x + along * dv.x;
  vec3 b = across * du.y + along * dv.y;
  float size = max(dot(t, t), dot(b, b));
  float scale = size == 0.0 ? 0.0 : inversesqrt(size);
  #ifdef DOUBLE
  scale *= face;
  #endif
  vec3 texel = texture(normalMap, normalMapUv).xyz * 2.0 - 1.0;
  n = normalize(mat3(t * scale, b * scale, n) * (texel * vec3(normalScale, 1.0)));
#endif
  float rough = roughness;
#ifdef ROUGHNESSMAP
  rough *= texture(roughnessMap, roughnessMapUv).g;
#endif
  float metal = metalness;
#ifdef METALNESSMAP
  metal *= texture(metalnessMap, metalnessMapUv).b;
#endif
  rough = min(max(rough, 0.045) + max(max(change.x, change.y), change.z), 1.0);
  vec3 matte = base.rgb * (1.0 - metal);
  vec3 f0 = mix(vec3(0.04), base.rgb, metal);
  vec3 v = normalize(-place);
  float nv = saturate(dot(n, v));
  vec2 dfg = texture(dfgTable, vec2(rough, nv)).rg;

  // The key light, which moves with the camera.
  vec3 l = normalize(vec3(-0.5, 1.0, 2.0));
  vec3 h = normalize(l + v);
  float nl = saturate(dot(n, l));
  float vh = saturate(dot(v, h));
  float alpha2 = pow2(pow2(rough));
  float toViewer = nl * sqrt(alpha2 + (1.0 - alpha2) * nv * nv);
  float toLight = nv * sqrt(alpha2 + (1.0 - alpha2) * nl * nl);
  float visible = 0.5 / max(toViewer + toLight, 1e-6);
  float facets = alpha2 / (PI * pow2(pow2(saturate(dot(n, h))) * (alpha2 - 1.0) + 1.0));
  float fresnel = exp2((-5.55473 * vh - 6.98316) * vh);
  vec3 lost = 1.0 + f0 * (1.0 / (dfg.x + dfg.y) - 1.0);
  vec3 key = (f0 * (1.0 - fresnel) + fresnel) * visible * facets * lost + matte / PI * 0.96 * (1.0 - fresnel);
  vec3 light = keyIntensity * nl * key;

  // The sky and the environment.
  vec3 single;
  vec3 multi;
  scatter(dfg, vec3(0.04), single, multi);
  vec3 scattered = matte * (1.0 - single - multi);
  float up = dot(n, viewMatrix[1].xyz) * 0.5 + 0.5;
  float ambient = occlusion();
  vec3 around = skyIntensity * mix(groundColor, vec3(1.0), up) / PI;
#ifdef ENVIRONMENT
  mat3 toWorld = transpose(mat3(viewMatrix));
  around += textureLod(environment, toWorld * n, maxLod).rgb * environmentIntensity;
  vec3 r = toWorld * normalize(mix(reflect(-v, n), n, pow2(pow2(rough))));
  vec3 radiance = textureLod(environment, r, maxLod * rough * (2.0 - rough)).rgb * environmentIntensity;
  vec3 metalSingle;
  vec3 metalMulti;
  scatter(dfg, base.rgb, metalSingle, metalMulti);
  vec3 mirrored = radiance * mix(single, metalSingle, metal) + mix(multi, metalMulti, metal) * around;
  light += mirrored * saturate(pow(nv + ambient, exp2(-16.0 * rough - 1.0)) - 1.0 + ambient);
#endif
  light += scattered * around * ambient;
#ifdef EMISSIVEMAP
  light += emissive * texture(emissiveMap, emissiveMapUv).rgb;
#else
  light += emissive;
#endif
  shown = vec4(toSrgb(light), base.a);
}`;function Me(o,{environment:e},t){let r="roughness"in o;return[t?"DEPTH":r?"STANDARD":"BASIC",...Y.map(i=>o[i]&&`${i.toUpperCase()} ${Ae(o[i])}`),o.vertexColors&&"COLOR",o.alphaTest>0&&"ALPHA_TEST",!o.transparent&&"OPAQUE",o.flatShading&&"FLAT",o.side&&"DOUBLE",r&&e&&"ENVIRONMENT"].filter(Boolean).map(i=>`#define ${i}
`).join("")}function Te(o,e,t){let r=Y.filter(u=>o[u]),n=new Set(r.map(u=>Ae(o[u]))),i=u=>r.map(u).join(`
`),s=[...n].map(u=>`in vec2 ${u};
`).join(""),a=i(u=>`uniform mat3 ${u}Matrix;out vec2 ${u}Uv;`),c=i(u=>`${u}Uv = (${u}Matrix * vec3(${u.toUpperCase()}, 1.0)).xy;`),l=i(u=>`uniform sampler2D ${u};in vec2 ${u}Uv;`),d=()=>Je.replace("GLSL",o.glsl??""),h=t?Qe:"roughness"in o?et:d();return[e+Ye.replace("IN_OUT",s+a).replace("UVS",c),e+Ze.replace("IN_OUT",l)+h]}function Ee(o,e){let t=Y.map(n=>(o[n]?.updateMatrix(),[`${n}Matrix`,o[n]?.matrix])),r={...Object.fromEntries(t),diffuse:o.color??ge,groundColor:ge};return{...o,...e,...r}}function Ae({channel:o}){return`uv${o||""}`}var Q=class{isWebGLRenderer=!0;domElement;xr={enabled:!1};capabilities;extensions={has:e=>this.#e.getExtension(e)!==null};properties={get:e=>({__webglTexture:this.#t.handleOf(e)})};state={useProgram:e=>this.#e.useProgram(e),bindTexture:(e,t,r)=>{this.#e.activeTexture(r),this.#e.bindTexture(e,t)}};#e;#t;#r;#n;#i;#o;#s=null;#l=null;#a=1;#c=[0,0,0,0];#d=null;#u;#m=()=>this.#h();constructor({canvas:e,...t}){this.domElement=e;let r=e.getContext("webgl2",t);if(!r)throw new Error("a WebGL 2 context could not be created");this.#e=r,this.#u=r.getExtension("WEBGL_lose_context"),this.capabilities={maxTextureSize:r.getParameter(r.MAX_TEXTURE_SIZE)},e.addEventListener("webglcontextrestored",this.#m),this.#h()}#h(){let e=this.#e;for(let t of["EXT_color_buffer_float","EXT_color_buffer_half_float"])e.getExtension(t);this.#t=new k(e),this.#r=new j(e),[this.#n,this.#i,this.#o]=[new WeakMap,new WeakSet,new WeakMap],this.#s=null}getContext(){return this.#e}getPixelRatio(){return this.#a}setPixelRatio(e){this.#a=e}setSize(e,t){let{domElement:r}=this;[r.width,r.height]=[e,t].map(n=>Math.floor(n*this.#a)),this.setViewport(0,0,e,t)}setViewport(e,t,r,n,i=!1){this.#c=[e,t,r,n].map(s=>Math.round(s*this.#a)),this.#d=i?this.#c:null}getRenderTarget(){return this.#l}getActiveCubeFace(){return 0}getActiveMipmapLevel(){return 0}setRenderTarget(e,t,r){this.#l=e}initTexture(e){this.#t.bind(e)}readRenderTargetPixels(e,...[t,r,n,i,s]){let a=this.#e;a.bindFramebuffer(a.FRAMEBUFFER,this.#t.framebuffer(e)),a.readPixels(t,r,n,i,a.RGBA,a.FLOAT,s)}render(e,t,{isDepth:r=!1}={}){let n=this.#e;if(n.isContextLost())return;e.updateMatrixWorld(),t.parent||t.updateMatrixWorld();let i=new b().copyInverse(t.matrixWorld),s=tt(e,i,r),c=s.some(({material:h})=>!Z(h))||r?this.#x(e):null,l=this.#l;n.bindFramebuffer(n.FRAMEBUFFER,l&&this.#t.framebuffer(l)),n.viewport(...l?[0,0,l.width,l.height]:this.#c);let d=l?null:this.#d;G(n,n.SCISSOR_TEST,d!==null),d&&n.scissor(...d),n.depthMask(!0),n.clearColor(0,0,0,0),n.clear(n.COLOR_BUFFER_BIT|n.DEPTH_BUFFER_BIT);for(let h of s){let{mesh:u,material:f}=h;u.onBeforeRender(this);let[m,y]=this.#b(f,c,r),x=new b().multiplyMatrices(i,u.matrixWorld),{projectionMatrix:v}=t,g={viewMatrix:i,modelViewMatrix:x,projectionMatrix:v,modelMatrix:u.matrixWorld};m.use({...y,...g},(I,Se)=>this.#t.bind(I,Se)),this.#y(f,r);let T=this.#v(u.geometry,m);f.transparent&&f.side===O&&!Z(f)&&!r&&(n.enable(n.CULL_FACE),n.cullFace(n.FRONT),this.#p(h),n.cullFace(n.BACK)),this.#p(h);for(let I of T)n.disableVertexAttribArray(I)}n.bindFramebuffer(n.FRAMEBUFFER,null)}dispose(){this.domElement.removeEventListener("webglcontextrestored",this.#m)}forceContextLoss(){this.#u?.loseContext()}forceContextRestore(){this.#u?.restoreContext()}#x({keyIntensity:e,skyIntensity:t,environmentIntensity:r,environment:n}){this.#s??=be(this.#e,this.#t);let i=n&&this.#o.get(n);if(n&&!i){i=xe(this.#e,this.#t,n),this.#o.set(n,i);let{texture:l}=i;B(n,()=>{l.dispose(),this.#o.delete(n)})}let{texture:s=null,maxLod:a=0}=i??{};return{...{keyIntensity:e,skyIntensity:t,environmentIntensity:r},environment:s,maxLod:a,dfgTable:this.#s}}#b(e,t,r){if(Z(e)&&!r){let{vertexShader:c,fragmentShader:l,uniforms:d}=e,h=c+l;return[this.#r.get(e,h,()=>[c,l]),Object.fromEntries(Object.entries(d).map(([f,{value:m}])=>[f,m]))]}let n=e,i=Me(n,t,r),s=i+(n.glsl??"");return[this.#r.get(e,s,()=>Te(n,i,r)),Ee(n,t)]}#y(e,t){let r=this.#e;G(r,r.BLEND,e.transparent&&!t),e.premultipliedAlpha?r.blendFunc(r.ONE,r.ONE_MINUS_SRC_ALPHA):r.blendFuncSeparate(r.SRC_ALPHA,r.ONE_MINUS_SRC_ALPHA,r.ONE,r.ONE_MINUS_SRC_ALPHA),G(r,r.DEPTH_TEST,e.depthTest),r.depthMask(e.depthWrite||t),G(r,r.CULL_FACE,e.side!==O),r.cullFace(r.BACK),G(r,r.POLYGON_OFFSET_FILL,e.polygonOffset&&!t),r.polygonOffset(e.polygonOffsetFactor,e.polygonOffsetUnits)}#v(e,{attributes:t}){let r=this.#e;this.#i.has(e)||(this.#i.add(e),B(e,()=>this.#g(e)));let n=[];for(let[i,s]of t){let a=e.attributes[i];!a||s<0||(a instanceof V?r.bindBuffer(r.ARRAY_BUFFER,a.buffer):this.#f(a,r.ARRAY_BUFFER),r.enableVertexAttribArray(s),r.vertexAttribPointer(s,a.itemSize,r.FLOAT,!1,0,0),n.push(s))}return e.index&&this.#f(e.index,r.ELEMENT_ARRAY_BUFFER),n}#f(e,t){let r=this.#e,n=this.#n.get(e);n||this.#n.set(e,n={handle:r.createBuffer(),version:-1}),r.bindBuffer(t,n.handle),n.version!==e.version&&(n.version=e.version,r.bufferData(t,e.array,e.usage))}#g({attributes:e,index:t}){for(let r of[...Object.values(e),t]){let n=r&&this.#n.get(r);n&&(this.#e.deleteBuffer(n.handle),this.#n.delete(r))}}#p({mesh:e,start:t,count:r}){let n=this.#e;e.geometry.index?n.drawElements(e.mode,r,n.UNSIGNED_INT,4*t):n.drawArrays(e.mode,t,r)}};function Z(o){return o instanceof z}function G(o,e,t){t?o.enable(e):o.disable(e)}function tt(o,e,t){let r=[],n=s=>{if(s.visible){s instanceof R&&(s.castShadow||!t)&&r.push(...rt(s,e));for(let a of s.children)n(a)}};n(o);let i=s=>s.mesh.renderOrder;return r.sort((s,a)=>Number(s.material.transparent)-Number(a.material.transparent)||i(s)-i(a)||(s.material.transparent?a.depth-s.depth:0))}function rt(o,e){let{geometry:t,material:r,matrixWorld:n}=o,{index:i,groups:s,drawRange:a,boundingSphere:c,attributes:l}=t,d=new p().copy(c?.center??new p),{z:h}=d.applyMatrix4(n).applyMatrix4(e),u=i?.count??l.position?.count??1/0;return(Array.isArray(r)?s:[{start:0,count:u,materialIndex:0}]).flatMap(({start:m,count:y,materialIndex:x=0})=>{let v=Math.max(m,a.start),g=Math.min(m+y,a.start+a.count)-v,T=[r].flat()[x];return T&&g>0?[{mesh:o,material:T,start:v,count:g,depth:-h}]:[]})}export{it as a,H as b,V as c,W as d,A as e,p as f,J as g,_ as h,b as i,ee as j,te as k,E as l,Pe as m,O as n,vt as o,z as p,ae as q,le as r,w as s,ce as t,ue as u,R as v,de as w,me as x,$ as y,he as z,fe as A,se as B,ut as C,dt as D,re as E,Ie as F,D as G,mt as H,_e as I,N as J,ht as K,ft as L,pt as M,L as N,ne as O,S as P,oe as Q,ie as R,Q as S};
/* Shaders are derived from those of three.js.

The MIT License

Copyright © 2010-2026 three.js authors

Permission is hereby granted, free of charge, to any person obtaining a copy
of this software and associated documentation files (the "Software"), to deal
in the Software without restriction, including without limitation the rights
to use, copy, modify, merge, publish, distribute, sublicense, and/or sell
copies of the Software, and to permit persons to whom the Software is
furnished to do so, subject to the following conditions:

The above copyright notice and this permission notice shall be included in
all copies or substantial portions of the Software.

THE SOFTWARE IS PROVIDED "AS IS", WITHOUT WARRANTY OF ANY KIND, EXPRESS OR
IMPLIED, INCLUDING BUT NOT LIMITED TO THE WARRANTIES OF MERCHANTABILITY,
FITNESS FOR A PARTICULAR PURPOSE AND NONINFRINGEMENT. IN NO EVENT SHALL THE
AUTHORS OR COPYRIGHT HOLDERS BE LIABLE FOR ANY CLAIM, DAMAGES OR OTHER
LIABILITY, WHETHER IN AN ACTION OF CONTRACT, TORT OR OTHERWISE, ARISING FROM,
OUT OF OR IN CONNECTION WITH THE SOFTWARE OR THE USE OR OTHER DEALINGS IN
THE SOFTWARE.
*/
