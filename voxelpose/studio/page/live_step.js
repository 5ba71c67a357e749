// Live: a session with its cameras and receivers, and the page on which the figure moves.

import { getJson } from "./api.js";
import { cameraRows } from "./camera_rows.js";
import { field, grouped, loopField } from "./form_fields.js";
import { allow, outcome } from "./job_panel.js";
import { button, make, rounded } from "./elements.js";

export async function liveStep(studio, state, project) {
  const known = await getJson(`api/live?project=${encodeURIComponent(project)}`);
  const step = { studio, project, known, typed: {}, loop: true, panel: make("div", { "aria-live": "polite" }), holder: make("div") };
  const rows = cameraRows(known);
  step.receivers = receiverRows(known.receivers, () => step.shown && studio.send("api/receivers", { receivers: step.receivers.values() }));
  const begin = () => studio.begin("api/live", {
    project, sources: rows.sources(), receivers: step.receivers.values(), loop: step.loop, settings: step.typed,
  }, step.holder);
  step.start = button("Start the session", begin, { class: "main", id: "start_live" });
  const last = make("div", { class: "row end" }, step.start);
  step.holder.append(
    make("section", { class: "job" }, make("h3", {}, "Cameras"),
      make("p", { class: "note" }, known.there.take.length ? "Without an address, the project's own videos are played as if filmed." : ""), rows.element),
    ...grouped(known.form, (row) => field(row.name === "camera" && known.cameras.length ? { ...row, input: "choice", choices: known.cameras, none: "all" } : row, step.typed), [], [loopField("live_loop", (on) => (step.loop = on))]));
  studio.watch(["live session"], [project], (job, busy) => show(step, job, busy));
  return [
    make("h2", {}, "Live"),
    make("p", { class: "lead" }, "Follows the person while the cameras run, and sends the motion to other programs. Nothing later is known, so a recorded take is estimated more accurately."),
    step.panel, step.holder,
    make("section", { class: "job" }, make("h3", {}, "Receivers"), make("p", {}, "Programs that take the motion, such as Blender or Unity: vmc://HOST:PORT or ws://HOST:PORT/PATH. They may be changed while the session runs."), step.receivers.element),
    last,
  ];
}

function receiverRows(addresses, changed) {
  const rows = make("div", { class: "camera_rows" });
  const add = (address) => {
    const row = make("div", { class: "row" },
      make("input", { type: "text", class: "grow", value: address, maxLength: 500, placeholder: "vmc://127.0.0.1:39539", "data-receiver": "", "aria-label": "Address of a receiver", onchange: changed }),
      button("Remove", () => {
        row.remove();
        changed();
      }, { class: "quiet small", "aria-label": `Remove ${address || "the receiver"}` }));
    rows.append(row);
  };
  addresses.forEach(add);
  const element = make("div", {}, rows, make("div", { class: "row" }, button("Add a receiver", () => add(""), { id: "add_receiver" })));
  return { element, values: () => [...rows.querySelectorAll("[data-receiver]")].map((input) => input.value.trim()).filter(Boolean) };
}

function show(step, job, busy) {
  const running = job.state === "running";
  allow(step.start, busy);
  step.holder.hidden = step.start.parentElement.hidden = running;
  if (running && job.phase) return session(step, job);
  step.shown = null;
  const done = () => [make("p", { class: "fine", id: "live_ended" }, `The session has ended: ${job.frames} pictures followed, ${job.dropped} left out for newer ones.`)];
  step.panel.replaceChildren(...outcome(job, step.project, done));
}

// The session as it goes; the elements stay, so that a button can be pressed.
function session(step, job) {
  const ask = (word) => () => step.studio.send("api/ask", { word });
  if (!step.shown) {
    step.words = make("p", { class: "phase", id: "live_phase" });
    step.pace = make("p", { class: "refused", id: "pace" });
    step.facts = make("div", { class: "facts" });
    step.record = button("Record", () => ask(step.recording ? "end recording" : "record")(), { class: "quiet" });
    step.run = button("Stop following", () => ask(step.stopped ? "start" : "stop")(), { class: "quiet" });
    step.shown = make("section", { class: "job", "aria-label": "Live session" }, step.words, step.pace, step.facts,
      make("div", { class: "row wrap end" },
        button("Learn the empty view", ask("background"), { class: "quiet", title: "Step out of all pictures" }), step.run, step.record,
        button("End the session", ask("finish"), { class: "quiet", id: "end_live" }),
        make("a", { class: "button main", id: "live_page", href: "live/-/", target: "live" }, "Open the live page")));
    step.panel.replaceChildren(step.shown);
  }
  Object.assign(step, { recording: job.recording, stopped: job.phase === "stopped" });
  step.words.textContent = job.message;
  step.words.classList.toggle("waits", job.phase === "countdown" || job.phase === "learning");
  step.pace.hidden = !job.pace && !job.trouble;
  step.pace.textContent = job.trouble || job.pace;
  step.record.textContent = job.recording ? "End recording" : "Record";
  step.run.textContent = step.stopped ? "Follow again" : "Stop following";
  const light = (good, name, words) => make("li", {}, make("i", { class: good ? "good" : "bad" }, "●"), make("b", {}, name), make("span", {}, words));
  step.facts.replaceChildren(
    make("ul", {},
      make("li", {}, make("b", {}, "pictures a second"), make("span", { id: "rates" }, `${rounded(job.fps, 1)} followed of ${rounded(job.arriving_fps, 1)}`)),
      make("li", {}, make("b", {}, "from picture to pose"), make("span", {}, job.latency_s === null ? "–" : `${rounded(1000 * job.latency_s, 0)} ms`)),
      make("li", {}, make("b", {}, "pictures followed"), make("span", {}, String(job.frames)))),
    make("ul", {}, ...Object.entries(job.cameras).map(([name, words]) => light(words === "ok", name, words))),
    ...(job.receivers.length ? [make("ul", { id: "receivers" }, ...job.receivers.map((one) => light(one.working, one.address, `${one.message}; ${one.sent} sent`)))] : []));
}
