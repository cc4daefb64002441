import{e as l,f as r,g as m,h as i,k as s,p as o,q as c}from"./chunk-3WQR7BN3.js";import"./chunk-4UEN2IM3.js";import"./chunk-D4QPOOG7.js";import"./chunk-WOT6VMZA.js";typeof customElements<"u"&&!customElements.get("reel-player")&&customElements.define("reel-player",r);async function P(){let e=o(),{view:f,bar:a,legend:y}=l(e),d=new Promise(u=>{for(let E of["timeupdate","error"])e.addEventListener(E,u,{once:!0})});f.camera.zoomsAlways=!0,a.isDetailed=!0,a.element.before(y.element);let n=m(),[t]=await Promise.all([n,i(e,n)]);document.title=`${t.name} – meshreel`,s("name").textContent=t.name,await d;let{inspect:w}=await import("./inspector-P45EPKFC.js");await w(e,t)}var p=P();window.player={ready:p};p.catch(e=>{e!==o().error&&c(e)});
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
