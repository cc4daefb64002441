// The camera of `meshreel render`: a long focal length, slightly from the side and above, as close as
// possible with all given points in view.

import * as THREE from "three";

const FIELD_OF_VIEW_DEG = 28;
const AZIMUTH_DEG = 30;
const ELEVATION_DEG = 12;
const MARGIN = 0.05;

/** 13 directions: half of the neighbors of a cell in a 3 x 3 x 3 grid. */
const DIRECTIONS = [-1, 0, 1]
  .flatMap((x) => [-1, 0, 1].flatMap((y) => [-1, 0, 1].map((z) => new THREE.Vector3(x, y, z))))
  .slice(14);

/** Return the extreme positions of (V, 3) along 13 lines, which suffice to frame all. */
export function extremePoints(positions: Float32Array): THREE.Vector3[] {
  const point = (offset: number) => new THREE.Vector3().fromArray(positions, offset);
  return DIRECTIONS.flatMap(({ x, y, z }) => {
    let [lowest, highest, low, high] = [0, 0, Infinity, -Infinity];
    for (let at = 0; at < positions.length; at += 3) {
      const projection = x * positions[at] + y * positions[at + 1] + z * positions[at + 2];
      if (projection < low) [lowest, low] = [at, projection];
      if (projection > high) [highest, high] = [at, projection];
    }
    return [point(lowest), point(highest)];
  });
}

export function createCamera(): THREE.PerspectiveCamera {
  return new THREE.PerspectiveCamera(FIELD_OF_VIEW_DEG, 1, 0.01, 100);
}

/** Set the aspect ratio; the field of view applies to the shorter side. */
export function setAspect(camera: THREE.PerspectiveCamera, aspect: number): void {
  const tangent = Math.tan(THREE.MathUtils.degToRad(FIELD_OF_VIEW_DEG / 2));
  camera.aspect = aspect;
  camera.fov = 2 * THREE.MathUtils.radToDeg(Math.atan(tangent / Math.min(1, aspect)));
  camera.updateProjectionMatrix();
}

/** Set the near and far planes around a box. */
export function setDepthRange(camera: THREE.PerspectiveCamera, box: THREE.Box3): void {
  const radius = box.getSize(new THREE.Vector3()).length() / 2 || 1;
  const distance = camera.position.distanceTo(box.getCenter(new THREE.Vector3()));
  camera.near = Math.max(distance - 1.5 * radius, radius * 1e-3);
  camera.far = distance + 1.5 * radius;
  camera.updateProjectionMatrix();
}

/** Move the camera so that all points are in view; returns the point that it looks at. */
export function framePoints(
  camera: THREE.PerspectiveCamera,
  points: THREE.Vector3[],
): THREE.Vector3 {
  const center = new THREE.Box3().setFromPoints(points).getCenter(new THREE.Vector3());
  const elevation = THREE.MathUtils.degToRad(90 - ELEVATION_DEG);
  const azimuth = THREE.MathUtils.degToRad(AZIMUTH_DEG);
  const back = new THREE.Vector3().setFromSphericalCoords(1, elevation, azimuth);
  camera.position.copy(center).add(back);
  camera.lookAt(center);
  camera.updateMatrixWorld();
  const eye = nearestEye(camera, points);
  camera.position.copy(eye);
  camera.updateMatrixWorld();
  // The target is on the view axis at the depth of the center, so that orbiting keeps the points centered.
  const depth = eye.clone().sub(center).dot(back);
  return eye.clone().addScaledVector(back, -depth);
}

// A point p is in view if |p_k - e_k| <= slope_k (e_z - p_z) for k = x, y in camera axes. Each side of
// the frustum gives one maximum over all points; these maxima determine the eye e.
function nearestEye(camera: THREE.PerspectiveCamera, points: THREE.Vector3[]): THREE.Vector3 {
  const toCamera = camera.quaternion.clone().invert();
  const local = points.map((point) => point.clone().applyQuaternion(toCamera));
  const tangent = Math.tan(THREE.MathUtils.degToRad(camera.fov / 2));
  const slopeY = tangent - 2 * MARGIN * tangent;
  const slopeX = tangent * camera.aspect - 2 * MARGIN * tangent;
  const side = (axis: "x" | "y", slope: number) => {
    const upper = Math.max(...local.map((p) => p[axis] + slope * p.z));
    const lower = Math.max(...local.map((p) => -p[axis] + slope * p.z));
    return { middle: (upper - lower) / 2, depth: (upper + lower) / (2 * slope) };
  };
  const x = side("x", slopeX);
  const y = side("y", slopeY);
  const nearest = Math.max(...local.map((p) => p.z));
  const farthest = Math.min(...local.map((p) => p.z));
  const clearance = 0.05 * (nearest - farthest) || 1;
  const eye = new THREE.Vector3(
    x.middle,
    y.middle,
    Math.max(x.depth, y.depth, nearest + clearance),
  );
  return eye.applyQuaternion(camera.quaternion);
}
