// What is drawn, clicked and chosen: beside what the files hold, with undo.

const clone = (value) => structuredClone(value);
const same = (one, other) => JSON.stringify(one) === JSON.stringify(other);

export class Store extends EventTarget {
  constructor(state) {
    super();
    this.state = state;
    this.doc = documentOf(state);
    this.saved = clone(this.doc);
    this.past = [];
    this.future = [];
    this.last = { label: "", at: 0 };
  }

  // Changes the document; changes of one label within a second are undone together.
  change(label, edit) {
    const before = clone(this.doc);
    edit(this.doc);
    if (same(before, this.doc)) return;
    const now = performance.now();
    if (label !== this.last.label || now - this.last.at > 1000 || !this.past.length) {
      this.past.push(before);
      if (this.past.length > 300) this.past.shift();
    }
    this.last = { label, at: now };
    this.future = [];
    this.tell();
  }

  // Begins and ends a drag, which is one change.
  hold() {
    this.held = clone(this.doc);
  }

  release() {
    if (this.held && !same(this.held, this.doc)) {
      this.past.push(this.held);
      this.future = [];
      this.last = { label: "", at: 0 };
    }
    this.held = null;
    this.tell();
  }

  step(from, to) {
    if (!from.length) return;
    to.push(this.doc);
    this.doc = from.pop();
    this.last = { label: "", at: 0 };
    this.tell();
  }

  undo() {
    this.step(this.past, this.future);
  }

  redo() {
    this.step(this.future, this.past);
  }

  tell() {
    this.dispatchEvent(new Event("change"));
  }

  // What differs from the files, as a request to save it.
  changes() {
    const changed = (kind) =>
      Object.fromEntries(
        Object.entries(this.doc[kind]).filter(([name, value]) => !same(value, this.saved[kind][name])),
      );
    const request = {
      places: { regions: changed("regions"), unknown: changed("unknown") },
      fit: changed("fit"),
    };
    if (request.fit.cameras) request.fit.cameras = request.fit.cameras.join(",");
    if (!same(this.doc.points, this.saved.points)) request.points = this.doc.points;
    return request;
  }

  get dirty() {
    return !same(this.doc, this.saved);
  }

  // Parts with changes, in words.
  get dirtyParts() {
    const { places, points, fit } = this.changes();
    const parts = [];
    if (Object.keys(places.regions).length) parts.push("regions");
    if (Object.keys(places.unknown).length) parts.push("unknown places");
    if (points) parts.push("points");
    if (Object.keys(fit).length) parts.push("settings");
    return parts;
  }

  // After saving: the files hold what was sent.
  adopt(state, sent) {
    const unchanged = same(sent, this.doc);
    const fresh = documentOf(state);
    this.state = state;
    fresh.points = sent.points.filter((point) => Object.keys(point.pixels).length);
    this.saved = fresh;
    if (unchanged) this.doc = { ...clone(fresh), points: this.doc.points };
    this.tell();
  }
}

function documentOf(state) {
  const regions = {}, unknown = {}, fit = {};
  for (const camera of state.cameras) {
    regions[camera.name] = {
      painted: camera.painted_region,
      polygons: clone(state.regions[camera.name] || []),
    };
    unknown[camera.name] = clone(state.unknown[camera.name] || []);
  }
  for (const name of ["background", "tolerance", "voxel", "repair", "stature", "cameras", "up"]) {
    const setting = state.settings[name];
    fit[name] = setting && setting.file === state.own_settings ? setting.value : null;
  }
  if (fit.cameras !== null) fit.cameras = fit.cameras.split(",").map((name) => name.trim()).filter(Boolean);
  return { regions, unknown, points: clone(state.points), fit };
}
