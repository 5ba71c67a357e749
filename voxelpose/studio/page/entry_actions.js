// What can be done with a whole project or result: another name, the bin, a duplicate.

import { button, make } from "./elements.js";
import { megabytes } from "./uploads.js";

export const date = (unix_s) => new Date(1000 * unix_s).toLocaleString(undefined, { dateStyle: "medium", timeStyle: "short" });

// Buttons that rename and delete, after that which makes another: a duplicate, or what is given.
export function entryActions(studio, name, another) {
  const row = make("div", { class: "row wrap actions" });
  const asking = (word, path, proposed) => small(word, () => askName(studio, row, name, word, path, proposed), name);
  const remove = async () => {
    if (confirm(`Delete ${name}? It lies in the bin for a day.`) && await studio.send("api/delete", { name })) await studio.show();
  };
  row.append(another ?? asking("Duplicate", "api/duplicate", `${name}_2`), asking("Rename", "api/rename", name), small("Delete", remove, name));
  return row;
}

const small = (text, act, name) => button(text, act, { class: "quiet small", "aria-label": `${text} ${name}` });

// Asks for a name in the place of the buttons, and has it given.
function askName(studio, row, name, word, path, proposed) {
  const input = make("input", { type: "text", class: "grow", value: proposed, maxLength: 80, "data-setting": "to", "aria-label": `New name of ${name}` });
  const give = async (event) => {
    event.preventDefault();
    if (await studio.send(path, { name, to: input.value.trim() }, row)) await studio.show();
  };
  row.replaceChildren(make("form", { class: "row wrap grow", onsubmit: give }, input,
    button(word, () => {}, { class: "main small" }), button("Cancel", () => studio.show(), { type: "button", class: "quiet small" })));
  input.select();
}

// What was deleted within a day, and can be put back.
export function bin(studio, deleted) {
  const put = (path, content) => async () => {
    if (await studio.send(path, content)) await studio.show();
  };
  return deleted.length > 0 && make("details", { id: "bin" }, make("summary", {}, "Bin", make("small", {}, `${deleted.length}, each for a day`)),
    make("div", { class: "card inner" },
      make("ul", {}, ...deleted.map((one) => make("li", {}, make("span", {}, one.name), make("small", {}, megabytes(one.bytes)),
        small("Put back", put("api/put_back", { deleted: one.id }), one.name)))),
      button("Empty the bin", put("api/empty", {}), { class: "quiet small" })));
}
