// The camera convention of `meshreel render`: a long lens, a little from the side and from above,
// as near as everything in the box of all frames stays in view.

import * as THREE from "three";

const FIELD_OF_VIEW_DEG = 28;
const AZIMUTH_DEG = 30;
const ELEVATION_DEG = 12;
const MARGIN = 0.06;

export function makeCamera(): THREE.PerspectiveCamera {
  return new THREE.PerspectiveCamera(FIELD_OF_VIEW_DEG, 1, 0.01, 100);
}

/** Gives the view the shape of its part of the screen; the field of view is of the shorter side. */
export function setAspect(camera: THREE.PerspectiveCamera, aspect: number): void {
  const tangent = Math.tan(THREE.MathUtils.degToRad(FIELD_OF_VIEW_DEG / 2));
  camera.aspect = aspect;
  camera.fov = 2 * THREE.MathUtils.radToDeg(Math.atan(tangent / Math.min(1, aspect)));
  camera.updateProjectionMatrix();
}

/** Puts the depth range around the box, wherever the camera has gone. */
export function setDepthRange(camera: THREE.PerspectiveCamera, box: THREE.Box3): void {
  const radius = box.getSize(new THREE.Vector3()).length() / 2 || 1;
  const distance = camera.position.distanceTo(box.getCenter(new THREE.Vector3()));
  camera.near = Math.max(distance - 1.5 * radius, radius * 1e-3);
  camera.far = distance + 1.5 * radius;
  camera.updateProjectionMatrix();
}

/** Moves the camera to where it sees the whole box; returns the point that it looks at. */
export function frameBox(camera: THREE.PerspectiveCamera, box: THREE.Box3): THREE.Vector3 {
  const centre = box.getCenter(new THREE.Vector3());
  const elevation = THREE.MathUtils.degToRad(90 - ELEVATION_DEG);
  const azimuth = THREE.MathUtils.degToRad(AZIMUTH_DEG);
  const back = new THREE.Vector3().setFromSphericalCoords(1, elevation, azimuth);
  camera.position.copy(centre).add(back);
  camera.lookAt(centre);
  camera.updateMatrixWorld();
  const eye = nearestEye(camera, cornersOf(box));
  camera.position.copy(eye);
  camera.updateMatrixWorld();
  // Looks straight on, at the depth of the centre, so that turning keeps the box in the middle.
  const depth = eye.clone().sub(centre).dot(back);
  return eye.clone().addScaledVector(back, -depth);
}

// A point p is inside where |p_k - e_k| <= slope_k (e_z - p_z) for k = x, y in camera axes: each
// side is bounded by one maximum over all points, and those maxima place the eye.
function nearestEye(camera: THREE.PerspectiveCamera, points: THREE.Vector3[]): THREE.Vector3 {
  const turn = camera.quaternion.clone().invert();
  const local = points.map((point) => point.clone().applyQuaternion(turn));
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

function cornersOf(box: THREE.Box3): THREE.Vector3[] {
  return [0, 1, 2, 3, 4, 5, 6, 7].map(
    (bits) =>
      new THREE.Vector3(
        bits & 1 ? box.max.x : box.min.x,
        bits & 2 ? box.max.y : box.min.y,
        bits & 4 ? box.max.z : box.min.z,
      ),
  );
}
