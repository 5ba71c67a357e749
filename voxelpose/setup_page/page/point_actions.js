// What is done with points of the scene; mixed into the page.

import { freeName } from "./elements.js";

export const pointActions = {
  // A new point whose name is typed next.
  addPoint() {
    this.wanted = "point_name";
    this.newPoint();
  },

  newPoint() {
    const taken = this.store.doc.points.map((point) => point.name);
    const name = freeName("point_", taken, taken.length + 1);
    this.point = name;
    this.store.change(`new ${name}`, (doc) => doc.points.push({ name, pixels: {}, position_m: null }));
    return name;
  },

  choosePoint(name) {
    this.point = name;
    this.show();
  },

  placePoint(view, pixel) {
    document.activeElement?.blur(); // arrow keys move the point
    const { points } = this.store.doc;
    if (!points.some((point) => point.name === this.point)) this.newPoint();
    this.store.change(`place ${Math.random()}`, (doc) => {
      doc.points.find((point) => point.name === this.point).pixels[view.name] = pixel;
    });
  },

  removeClick(name, camera) {
    this.store.change(`unclick ${Math.random()}`, (doc) => {
      const point = doc.points.find((each) => each.name === name);
      if (point) delete point.pixels[camera];
    });
  },

  removePoint(name) {
    this.store.change(`remove ${Math.random()}`, (doc) => {
      doc.points = doc.points.filter((point) => point.name !== name);
    });
    this.choosePoint(this.store.doc.points[0]?.name ?? null);
  },

  renamePoint(name, wanted) {
    const text = wanted.replace(/["\s,]+/g, " ").trim();
    const taken = this.store.doc.points.some((point) => point.name === text && text !== name);
    if (text && !taken) {
      this.point = text;
      this.store.change(`rename ${name}`, (doc) => {
        doc.points.find((point) => point.name === name).name = text;
      });
    }
    if (taken) this.status(`there is a point ${text} already`);
    this.show();
  },
};
