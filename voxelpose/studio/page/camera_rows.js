// Names and addresses of cameras, which can be added and removed.

import { button, freeName, make } from "./elements.js";

// Rows for the cameras of the last time, or for the webcams that are there.
export function cameraRows(known) {
  const list = make("datalist", { id: "addresses" },
    ...known.webcams.map((webcam) => make("option", { value: String(webcam.number) }, webcam.name)),
    ...known.videos.map((video) => make("option", { value: video })));
  const rows = make("div", { class: "camera_rows" });
  const names = () => [...rows.querySelectorAll("[data-name]")].map((input) => input.value.trim());
  const free = () => {
    const next = known.cameras.find((name) => !names().includes(name));
    return next ?? freeName("cam_", names());
  };
  const add = (name, address) => {
    const row = make("div", { class: "row" },
      make("input", { type: "text", value: name, maxLength: 80, "data-name": "", "aria-label": "Name of the camera" }),
      make("input", { type: "text", class: "grow", value: address, maxLength: 1000, placeholder: "0, rtsp://…, or a video", "data-address": "", "aria-label": `Address of ${name}` }),
      button("Remove", () => row.remove(), { class: "quiet small", "aria-label": `Remove ${name}` }));
    row.querySelector("[data-address]").setAttribute("list", "addresses");
    rows.append(row);
  };
  for (const { name, address } of known.sources) add(name, address);
  if (!known.sources.length) for (const webcam of known.webcams) add(free(), String(webcam.number));
  if (!rows.childElementCount) add(free(), "");
  const found = known.webcams.length ? `Webcams here: ${known.webcams.map((webcam) => `${webcam.number} ${webcam.name}`).join(", ")}.` : "No webcam was found at this machine.";
  const element = make("div", {}, list,
    make("p", {}, "The name is that of the camera in the calibration. The address is the number of a webcam, the address of a network camera, or a video in the studio's folder that is played as if filmed."),
    rows, make("div", { class: "row wrap" }, button("Add a camera", () => add(free(), ""), { id: "add_camera" }), make("small", { class: "note" }, found)));
  const sources = () => [...rows.children].map((row) => ({ name: row.querySelector("[data-name]").value.trim(), address: row.querySelector("[data-address]").value.trim() })).filter(({ name, address }) => name && address);
  return { element, sources };
}
