// The question whether files may be replaced, which shows both sides.

import { button, make } from "./elements.js";
import { isOf, megabytes, STILLS, VIDEOS } from "./uploads.js";

// Answers "replace", "keep" (and add the others), or "" where nothing is to be done.
export function askToReplace(project, conflicts, chosen) {
  const dialog = make("dialog", { class: "job", "aria-label": `Replace files of ${project}?` });
  const side = (title, { name, files, bytes, modified }, picture) => make("div", {},
    make("h4", {}, title), picture, make("p", {}, files > 1 ? `${name} and ${files - 1} more` : name),
    make("p", { class: "note" }, `${megabytes(bytes)}, ${new Date(1000 * modified).toLocaleString()}`));
  const picture = (file) => {
    if (!isOf(file.name, `${STILLS},${VIDEOS}`)) return null;
    const src = URL.createObjectURL(file);
    return isOf(file.name, STILLS) ? make("img", { src, alt: "" }) : make("video", { src, muted: true, preload: "metadata" });
  };
  return new Promise((done) => {
    const answer = (text, value, more) => button(text, () => dialog.close(value), more);
    dialog.append(
      make("h3", {}, `${project} has ${conflicts.length === 1 ? "this" : "these"} already`),
      ...conflicts.map((row) => make("div", { class: "sides" },
        side("there now", row, row.picture && make("img", { src: `still?${new URLSearchParams({ project, name: row.picture })}`, alt: "", loading: "lazy" })),
        side("new", row.new, picture(chosen[row.new.number].file)))),
      make("div", { class: "row end" }, answer("Cancel", "", { class: "quiet" }), answer("Keep what is there", "keep"), answer("Replace", "replace", { class: "main" })));
    dialog.addEventListener("close", () => {
      dialog.remove();
      done(dialog.returnValue);
    });
    document.body.append(dialog);
    dialog.showModal();
  });
}
