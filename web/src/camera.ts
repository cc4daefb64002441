// The camera convention of `meshreel render`: a long lens, a little from the side and from above,
// as near as every point that it is given stays in view.

import * as THREE from "three";

const FIELD_OF_VIEW_DEG = 28;
const AZIMUTH_DEG = 30;
const ELEVATION_DEG = 12;
const MARGIN = 0.05;

/** 13 lines through the middle of a cube. */
const DIRECTIONS = [-1, 0, 1]
  .flatMap((x) => [-1, 0, 1].flatMap((y) => [-1, 0, 1].map((z) => new THREE.Vector3(x, y, z))))
  .slice(14);

/** The outermost of positions (V, 3), both ways along some lines: they frame all. */
export function outermost(positions: Float32Array): THREE.Vector3[] {
  const point = (at: number) => new THREE.Vector3().fromArray(positions, at);
  return DIRECTIONS.flatMap(({ x, y, z }) => {
    let [least, most, low, high] = [0, 0, Infinity, -Infinity];
    for (let at = 0; at < positions.length; at += 3) {
      const along = x * positions[at] + y * positions[at + 1] + z * positions[at + 2];
      if (along < low) [least, low] = [at, along];
      if (along > high) [most, high] = [at, along];
    }
    return [point(least), point(most)];
  });
}

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

/** Moves the camera to where it sees all points; returns the point that it looks at. */
export function framePoints(
  camera: THREE.PerspectiveCamera,
  points: THREE.Vector3[],
): THREE.Vector3 {
  const centre = new THREE.Box3().setFromPoints(points).getCenter(new THREE.Vector3());
  const elevation = THREE.MathUtils.degToRad(90 - ELEVATION_DEG);
  const azimuth = THREE.MathUtils.degToRad(AZIMUTH_DEG);
  const back = new THREE.Vector3().setFromSphericalCoords(1, elevation, azimuth);
  camera.position.copy(centre).add(back);
  camera.lookAt(centre);
  camera.updateMatrixWorld();
  const eye = nearestEye(camera, points);
  camera.position.copy(eye);
  camera.updateMatrixWorld();
  // Looks straight on, at the depth of the centre, so that turning keeps the points in the middle.
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
