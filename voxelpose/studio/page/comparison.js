// Two results of a recording beside each other, of which each shows the frame that the other is taken to.

import { choice, make } from "./elements.js";

// `pathOf` is the viewer of a result by its name.
export function comparison(results, pathOf) {
  const names = results.map((result) => result.name);
  const chosen = names.slice(0, 2);
  const beside = make("div", { class: "beside" });
  const draw = () => {
    const frames = chosen.map((name) => make("iframe", { src: pathOf(name), title: `Viewer of ${name}` }));
    beside.replaceChildren(...frames);
    link(frames);
  };
  const pick = (side) => choice(`${side ? "Second" : "First"} result`, names.map((name) => [name, name]), chosen[side], (name) => {
    chosen[side] = name;
    draw();
  });
  return make("details", { ontoggle: (event) => (event.target.open ? draw() : beside.replaceChildren()) },
    make("summary", {}, "Compare two results"), make("div", { class: "inner" }, make("div", { class: "row wrap" }, pick(0), pick(1)), beside));
}

function link(frames) {
  let seen = [];
  const follow = () => {
    if (!frames[0].isConnected) return;
    const lines = frames.map((each) => each.contentWindow?.viewer?.player?.timeline);
    if (lines.every(Boolean)) {
      const moved = lines.findIndex((line, side) => line.frame !== seen[side]);
      if (moved >= 0) lines[1 - moved].seek(lines[moved].frame - lines[1 - moved].scene.first);
      seen = lines.map((line) => line.frame);
    }
    requestAnimationFrame(follow);
  };
  follow();
}
