"""WebGL resources of a page."""

COUNTING = """
window.alive = {};
for (const kind of ["Buffer", "Texture", "Program", "VertexArray", "TransformFeedback",
                    "Framebuffer", "Shader"]) {
  const { prototype } = WebGL2RenderingContext;
  const [make, free] = [prototype[`create${kind}`], prototype[`delete${kind}`]];
  const alive = new Set();
  prototype[`create${kind}`] = function (...given) {
    const made = make.apply(this, given);
    alive.add(made);
    return made;
  };
  prototype[`delete${kind}`] = function (one) {
    alive.delete(one);
    free.call(this, one);
  };
  Object.defineProperty(window.alive, kind, { enumerable: true, get: () => alive.size });
}
"""
"""Script before all others: counts live WebGL objects by kind in `window.alive`."""
