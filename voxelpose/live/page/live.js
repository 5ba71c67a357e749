// The live page: the newest pose of everybody, the cameras' pictures, and the session's buttons.

import { getJson, postJson } from "./api.js";
import { Body, unpacked } from "./body.js";
import { checkbox, css, make, notice, swatch } from "./elements.js";
import { barOfStudio } from "./job_bar.js";
import { Player } from "./player.js";
import { drawPictures, filmed, otherPoses, part } from "./shown_frame.js";

const BUSY = ["countdown", "learning", "searching"];
const POINT = 0.016;  // width of a voxel's mark, m
const LONGEST_S = 0.04;  // that a stage's bar is long for, at least
const ms = (seconds) => `${(1000 * seconds).toFixed(1)} ms`;

class Live {
  constructor(scene) {
    Object.assign(this, { scene, people: scene.colours.map((colour) => ({ colour, there: false })), turn: 0 });
    this.#addParts();
    barOfStudio();
    this.player = new Player(document.body, scene, this);
    const events = new EventSource("events");
    events.addEventListener("message", ({ data }) => {
      notice("");
      this.#take(JSON.parse(data));
    });
    events.addEventListener("error", () => notice("The session has ended or cannot be reached."));
  }

  // What the player's page lacks.
  #addParts() {
    const button = (text, word, title) => make("button", { title, onclick: () => this.#ask(word) }, text);
    this.recording = make("button", { title: "The cameras' pictures, into a recording",
      onclick: () => this.#ask(this.records ? "end recording" : "record") }, "Record");
    part("layers").parentElement.before(
      make("section", { class: "status" }, make("div", { class: "lines", role: "status" }), make("div", { class: "buttons" },
        button("Background", "background", "Learns the empty room"), button("Start", "start", "Looks for a person"),
        button("Stop", "stop", "The cameras go on"), this.recording)),
      make("section", {}, make("h2", {}, "Now"), make("div", { class: "rows" })),
      make("section", { class: "links" }, make("h2", {}, "Cameras and receivers"), make("div", { class: "list" })));
    part("keys").replaceChildren(part("keys").lastElementChild);
  }

  async #ask(word) {
    try {
      await postJson("api/ask", { word });
    } catch (error) {
      notice(error.message);
    }
  }

  layers(player) {
    const named = { pictures: "Pictures", outlines: "Outlines", person: "Person", hull: "Voxels", hypotheses: "Other poses" };
    return Object.entries(named).map(([name, words]) => {
      player.shown[name] = true;
      return make("div", { class: "layer" }, checkbox(words, true, (on) => player.show(name, on)));
    });
  }

  legend() {
    const { colours, hull_colour: hull } = this.scene;
    const people = colours.length > 1 ? colours.map((colour, k) => swatch([colour], `person ${k + 1}`)) : [];
    return [...people, swatch([hull], "voxels of the hull"), swatch([[225, 225, 225]], "other likely poses of one camera")];
  }

  #take(event) {
    if (event.state) this.#tell(event.state);
    if (!event.people) return;
    event.people.forEach((sent, k) => this.#place(this.people[k], sent, k));
    this.#points(unpacked(event.hull));
    this.others = otherPoses(this.player.renderer, event.hypotheses, this.others);
    this.#nextPicture();
    this.player.redraw();
  }

  #place(person, sent, k) {
    person.there = Boolean(sent);
    if (sent && person.body?.version !== sent.version) this.#fetchBody(person, k);
    if (!sent || !person.body) return;
    person.body.root = unpacked(sent.root);
    person.body.turn = unpacked(sent.turn);
    person.body.place(0);
    this.player.renderer.place(person.skin, person.body.places, person.paint);
  }

  async #fetchBody(person, k) {
    if (person.asked) return;
    person.asked = true;
    try {
      const body = new Body(await getJson(`api/body?person=${k}`));
      person.paint = new Uint8Array(3 * body.count).map((_, n) => person.colour[n % 3]);
      this.player.renderer.drop(person.skin?.mesh);
      person.skin = this.player.renderer.skin(body);
      body.place(0);
      this.player.renderer.place(person.skin, body.places, person.paint);
      person.body = body;
    } catch (error) {
      notice(error.message);
    }
    person.asked = false;
  }

  #points(places) {
    this.player.renderer.drop(this.hull);
    this.hull = places.length ? this.player.renderer.balls(places, this.scene.hull_colour) : null;
  }

  // With every second moment one camera's picture, in turn: they cost most.
  async #nextPicture() {
    const { cameras, renderer, shown } = this.player;
    this.turn += 1;
    if (this.loading || this.turn % 2 || !shown.cameras || !shown.pictures) return;
    this.loading = true;
    const camera = cameras[(this.turn / 2) % cameras.length];
    try {
      const answer = await fetch(`picture/${encodeURIComponent(camera.name)}${shown.outlines ? "?outlines=1" : ""}`);
      if (answer.ok) filmed(renderer, camera, await createImageBitmap(await answer.blob()));
    } catch {
      // The stream of events says that the session is gone.
    }
    this.loading = false;
  }

  pictures(player) {
    if (player.shown.pictures) drawPictures(player);
  }

  draw(player) {
    const { renderer, scene, shown } = player;
    const there = this.people.filter(({ there: seen, body }) => shown.person && seen && body);
    if (!player.viewpoint.through) there.forEach(({ skin }) => renderer.drawShadow(skin.mesh, scene.floor_m + 0.002));
    there.forEach(({ skin }) => renderer.drawSolid(skin.mesh));
    if (shown.hull && this.hull) renderer.drawSolid(this.hull, POINT);
  }

  over(player) {
    if (player.shown.hypotheses && this.others) player.renderer.drawSolid(this.others);
  }

  #tell({ session, pace, note, confidence, receivers }) {
    this.records = session.recording;
    this.recording.textContent = session.recording ? "End recording" : "Record";
    const kind = session.phase === "following" ? "good" : BUSY.includes(session.phase) ? "busy" : "bad";
    part("lines").replaceChildren(
      make("p", {}, make("span", { class: `phase ${kind}` }, session.phase),
        session.recording && make("span", { class: "bad" }, " ", make("b", {}, "● recording"))),
      session.message !== session.phase && make("p", {}, session.message), pace && make("p", {}, pace), note && make("p", { class: "warning" }, `⚠ ${note}`));
    const sure = confidence.map((share) => (share === null ? "–" : `${(100 * share).toFixed(0)} %`));
    const facts = [
      ["frames per second", `${session.fps.toFixed(1)} of ${session.arriving_fps.toFixed(1)}`],
      ["latency", session.latency_s === null ? "–" : `${(1000 * session.latency_s).toFixed(0)} ms`],
      ["frames", `${session.frames}, ${session.dropped} dropped`],
      ...sure.map((share, k) => [sure.length > 1 ? `confidence of person ${k + 1}` : "confidence", share]),
    ];
    const stages = Object.entries(session.stage_s).filter(([, seconds]) => seconds !== null);
    const longest = Math.max(LONGEST_S, ...stages.map(([, seconds]) => seconds));
    part("rows").replaceChildren(
      ...facts.flatMap(([name, value], k) => [make("span", {}, k > 2 && sure.length > 1 ? this.#mark(k - 3) : "", name), make("b", {}, value)]),
      ...stages.flatMap(([name, seconds]) => [make("span", {}, name), make("b", {}, ms(seconds)),
        make("meter", { max: longest, value: seconds, "aria-label": name })]));
    part("list").replaceChildren(
      ...Object.entries(session.cameras).map(([name, words]) => this.#link(name, words, words === "ok")),
      ...receivers.map(({ address, message, working, sent, dropped, send_s: took }) => this.#link(
        address, `${message} (${sent} sent, ${dropped} dropped${took === null ? "" : `, ${ms(took)}`})`, working)));
  }

  #mark(k) {
    const mark = make("span", {}, "● ");
    mark.style.color = css(this.scene.colours[k]);
    return mark;
  }

  #link(name, words, good) {
    return make("p", {}, make("span", { class: good ? "good" : "bad" }, "● "), make("b", {}, name), ` ${words}`);
  }
}

try {
  window.live = new Live(await getJson("api/scene"));
} catch (error) {
  notice(error.message);
}
