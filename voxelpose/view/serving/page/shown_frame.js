// What the viewer and the live page draw beside the player's own: pictures of cameras, and other poses.

import { unpacked } from "./body.js";
import { boneFaces } from "./renderer.js";

export const part = (name) => document.querySelector(`.${name}`);
export const LIKELY = 225;
export const UNLIKELY = 68;

// Likely poses as skeletons, the likelier the brighter, in the place of those before; null: none.
export function otherPoses(renderer, hypotheses, before) {
  renderer.drop(before);
  const [faces, normals, colours] = [[], [], []];
  for (const { ends: sent, share } of hypotheses) {
    const ends = unpacked(sent);
    const grey = Math.round(UNLIKELY + (LIKELY - UNLIKELY) * Math.min(share, 1));
    for (let k = 0; k < ends.length; k += 6) boneFaces([...ends.slice(k, k + 3)], [...ends.slice(k + 3, k + 6)], 0.009, faces, normals);
    while (colours.length < faces.length) colours.push(grey);
  }
  return faces.length ? renderer.surface(new Float32Array(faces), new Float32Array(normals), new Uint8Array(colours)) : null;
}

// Takes over a picture, which is not needed any more then.
export function filmed(renderer, camera, image) {
  camera.texture ??= renderer.texture();
  renderer.picture(camera.texture, image);
  image.close();
}

export const drawPictures = ({ cameras, depth, renderer }) => cameras.filter(({ texture, empty }) => texture && !empty).forEach(
  (camera) => renderer.drawPicture(camera.texture, camera.corners(depth)));
