import{e,f as t,g as a,h as r,k as s,p as n,q as o}from"./chunk-G4C33QT2.js";import"./chunk-2VFTGSKO.js";import"./chunk-DZDRKIBM.js";import"./chunk-TN22GKP4.js";typeof customElements<"u"&&!customElements.get("reel-player")&&customElements.define("reel-player",t);var m=async function(){let t=n(),{view:o,bar:m,legend:i}=e(t),l=new Promise(e=>{for(let a of["timeupdate","error"])t.addEventListener(a,e,{once:!0})});o.camera.zoomsAlways=!0,m.isDetailed=!0,m.element.before(i.element);let c=a(),[p]=await Promise.all([c,r(t,c)]);document.title=`${p.name} – meshreel`,s("name").textContent=p.name,await l;let{inspect:u}=await(import("./inspector-WBVO7J2R.js"));await u(t,p)}();window.player={ready:m},m.catch(e=>{e!==n().error&&o(e)});/* Shaders are derived from those of three.js.

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
