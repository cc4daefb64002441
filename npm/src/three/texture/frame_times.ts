// Converts between times of a video and frames of a mesh.

/** Tolerance for times that containers round: WebM rounds to milliseconds. */
const ROUNDING_S = 0.002;

/** Distance of seek times from the borders of a frame, in frames. */
const MARGIN = 0.25;

/**
 * Return the position in frames at a time of the video.
 *
 * @param timeS - time of an image in seconds since the first frame of the mesh
 */
export function frameAtTime(timeS: number, fps: number): number {
  const position = timeS * fps;
  const nearest = Math.round(position);
  const isFrame = Math.abs(position - nearest) <= Math.min(ROUNDING_S * fps, MARGIN);
  return Math.max(isFrame ? nearest : position, 0);
}

/** Return the time in seconds to which the video must seek for a position in frames. */
export function seekTime(position: number, fps: number): number {
  const frame = Math.floor(position);
  const inside = Math.min(Math.max(position - frame, MARGIN), 1 - MARGIN);
  return (frame + inside) / fps;
}

/** The common length of a mesh and a video. */
export interface CommonLength {
  /** Number of frames in both; at least 1. */
  readonly nFrames: number;
  /** Warning if one is longer than the other, else null. */
  readonly warning: string | null;
}

/**
 * Compute the common length of a mesh and a video.
 *
 * @param nFrames - frames of the mesh
 * @param videoS - seconds of the video after the first frame of the mesh; not finite if unknown
 */
export function commonLength(nFrames: number, fps: number, videoS: number): CommonLength {
  if (!Number.isFinite(videoS)) return { nFrames, warning: null };
  const pictures = Math.max(Math.round(videoS * fps), 1);
  const common = Math.min(nFrames, pictures);
  if (Math.abs(pictures - nFrames) <= 1) return { nFrames: common, warning: null };
  const [mesh, video] = [nFrames / fps, videoS].map((seconds) => `${seconds.toFixed(2)} s`);
  const longer = pictures > nFrames ? "video" : "mesh";
  const warning =
    `the mesh lasts ${mesh} and the video ${video}: only the first ${(common / fps).toFixed(2)} s` +
      ` are played, without the end of the ${longer}`;
  return { nFrames: common, warning };
}
