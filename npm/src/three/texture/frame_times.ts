// Which frame of a mesh belongs to a picture of a video, and where that video is sought.

/** Times of containers are rounded, to milliseconds in WebM: this much off is the frame itself. */
const ROUNDING_S = 0.002;

/** A video is sought a little behind the beginning of a picture, never on the edge of two. */
const INSIDE = 0.25;

/**
 * The place in frames that belongs to a picture of a video.
 *
 * @param timeS - of the picture, in seconds since the first frame of the mesh
 */
export function placeOf(timeS: number, fps: number): number {
  const place = timeS * fps;
  const nearest = Math.round(place);
  const isFrame = Math.abs(place - nearest) <= Math.min(ROUNDING_S * fps, INSIDE);
  return Math.max(isFrame ? nearest : place, 0);
}

/** The time in seconds at which a video shows the picture of a place in frames. */
export function timeOf(place: number, fps: number): number {
  const frame = Math.floor(place);
  const inside = Math.min(Math.max(place - frame, INSIDE), 1 - INSIDE);
  return (frame + inside) / fps;
}

/** What a mesh and a video have in common. */
export interface Common {
  /** Frames that both have, at least 1. */
  readonly nFrames: number;
  /** What is to be said where one of them is longer; null where they are of one length. */
  readonly warning: string | null;
}

/**
 * The length that a mesh and a video have in common.
 *
 * @param nFrames - of the mesh
 * @param videoS - seconds of the video after the first frame of the mesh; not finite if unknown
 */
export function commonOf(nFrames: number, fps: number, videoS: number): Common {
  if (!Number.isFinite(videoS)) return { nFrames, warning: null };
  const pictures = Math.max(Math.round(videoS * fps), 1);
  const common = Math.min(nFrames, pictures);
  if (Math.abs(pictures - nFrames) <= 1) return { nFrames: common, warning: null };
  const [mesh, video] = [nFrames / fps, videoS].map((seconds) => `${seconds.toFixed(2)} s`);
  const longer = pictures > nFrames ? "video" : "mesh";
  const warning =
    `the mesh lasts ${mesh} and its video ${video}: ${(common / fps).toFixed(2)} s are played,` +
    ` and the end of the ${longer} is not shown`;
  return { nFrames: common, warning };
}
