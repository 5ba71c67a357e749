// Mouse and keys on the enlarged camera: polygons and points.

import { middleOf } from "./camera_view.js";
import { Pointer, at, distance } from "./pointer.js";

const NEAR = 9; // screen pixels
const PLACE = { region: "regions", unknown: "unknown" };

export const polygonsOf = (doc, kind, camera) =>
  kind === "region" ? doc.regions[camera].polygons : doc.unknown[camera];

export class DrawingPointer extends Pointer {
  get drawing() {
    return this.app.tool in PLACE;
  }

  hold() {
    this.app.store.hold();
  }

  release() {
    this.app.store.release();
  }

  leave(view) {
    this.app.loupe.hide();
    this.app.overlays.explain(null);
    if (this.app.draft) this.app.draft.cursor = null;
    view.draw();
  }

  hover(view, event) {
    const { app } = this;
    view.measure();
    const pixel = view.toPixel(at(event));
    if (app.draft?.camera === view.name) {
      app.draft.cursor = view.within(pixel);
      view.draw();
    }
    if (app.tool === "points" && view.contains(pixel)) app.loupe.show(view, view.within(pixel));
    else app.loupe.hide();
    const explained = app.tool === "silhouettes" && view.contains(pixel);
    app.overlays.explain(explained ? { camera: view.name, pixel } : null);
  }

  // What is under the mouse and can be moved.
  grab(view, position) {
    const { app } = this;
    const near = (pixel) => distance(view.toCanvas(pixel), position) <= NEAR;
    if (app.tool === "points") {
      const point = app.store.doc.points.find(
        (each) => each.pixels[view.name] && near(each.pixels[view.name]),
      );
      return point ? { point: point.name } : null;
    }
    if (!this.drawing || app.draft) return null;
    const polygons = polygonsOf(app.store.doc, app.tool, view.name);
    for (const [index, polygon] of polygons.entries()) {
      const corner = polygon.findIndex(near);
      if (corner >= 0) return { kind: app.tool, index, corner };
    }
    const index = app.chosen?.kind === app.tool ? app.chosen.index : -1;
    const polygon = polygons[index];
    if (!polygon) return null;
    const edge = polygon.findIndex((pixel, n) =>
      near(middleOf(pixel, polygon[(n + 1) % polygon.length])));
    return edge >= 0 ? { kind: app.tool, index, corner: edge + 1, insert: true } : null;
  }

  dragTo(view, grabbed, position) {
    const { app } = this;
    const pixel = view.within(view.toPixel(position));
    if (grabbed.point) {
      app.store.doc.points.find((each) => each.name === grabbed.point).pixels[view.name] = pixel;
      app.point = grabbed.point;
    } else {
      const polygon = polygonsOf(app.store.doc, grabbed.kind, view.name)[grabbed.index];
      if (grabbed.insert) polygon.splice(grabbed.corner, 0, pixel);
      grabbed.insert = false;
      polygon[grabbed.corner] = pixel;
      app.chosen = { ...grabbed };
    }
    view.draw();
  }

  click(view, position, event, grabbed) {
    const { app } = this;
    const pixel = view.toPixel(position);
    if (grabbed?.point) {
      app.choosePoint(grabbed.point);
    } else if (app.tool === "points") {
      if (view.contains(pixel)) app.placePoint(view, view.within(pixel));
    } else if (grabbed && !grabbed.insert) {
      app.chosen = grabbed;
      app.show();
    } else if (app.draft) {
      const first = view.toCanvas(app.draft.corners[0]);
      const closes = distance(first, position) <= NEAR || event.detail > 1;
      if (closes) this.close();
      else app.draft.corners.push(view.within(pixel));
      app.show();
    } else if (this.drawing) {
      const polygons = polygonsOf(app.store.doc, app.tool, view.name);
      const index = polygons.findLastIndex((polygon) => inside(pixel, polygon));
      if (index >= 0 && !event.shiftKey) {
        app.chosen = { kind: app.tool, index };
      } else {
        app.chosen = null;
        app.draft = { kind: app.tool, camera: view.name, corners: [view.within(pixel)] };
      }
      app.show();
    }
  }

  // Ends the polygon that is being drawn.
  close() {
    const { app } = this;
    const { kind, camera, corners } = app.draft;
    if (corners.length < 3) return;
    app.draft = null;
    app.store.change(`polygon ${Math.random()}`, (doc) => {
      const polygons = polygonsOf(doc, kind, camera);
      polygons.push(corners);
      app.chosen = { kind, index: polygons.length - 1 };
    });
    app.show();
  }

  // Keys while a camera is enlarged; returns whether one was understood.
  key(view, event) {
    const { app } = this;
    if (event.key === "Escape" && app.draft) {
      app.draft = null;
    } else if (event.key === "Enter" && app.draft) {
      this.close();
    } else if (event.key === "Delete" || event.key === "Backspace") {
      this.remove(view);
    } else if (event.key.startsWith("Arrow") && app.tool === "points" && this.nudge(view, event)) {
      return true;
    } else {
      return super.key(view, event);
    }
    app.show();
    return true;
  }

  remove(view) {
    const { app } = this;
    if (app.draft) {
      app.draft.corners.pop();
      if (!app.draft.corners.length) app.draft = null;
    } else if (app.tool === "points") {
      app.removeClick(app.point, view.name);
    } else if (this.drawing && app.chosen) {
      const { kind, index, corner } = app.chosen;
      app.store.change(`remove ${Math.random()}`, (doc) => {
        const polygons = polygonsOf(doc, kind, view.name);
        if (corner !== undefined && polygons[index].length > 3) polygons[index].splice(corner, 1);
        else polygons.splice(index, 1);
      });
      app.chosen = null;
    }
  }

  // Moves the chosen point by a tenth of a pixel, with Shift by a whole one.
  nudge(view, event) {
    const { app } = this;
    const steps = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
    const [dx, dy] = steps[event.key];
    const size = event.shiftKey ? 1 : 0.1;
    const point = app.store.doc.points.find((each) => each.name === app.point);
    const pixel = point?.pixels[view.name];
    if (!pixel) return false;
    const moved = view.within([pixel[0] + dx * size, pixel[1] + dy * size]);
    app.store.change(`nudge ${app.point} ${view.name}`, (doc) => {
      doc.points.find((each) => each.name === app.point).pixels[view.name] = moved;
    });
    app.loupe.show(view, moved);
    return true;
  }
}

function inside([x, y], polygon) {
  let within = false;
  polygon.forEach(([ax, ay], index) => {
    const [bx, by] = polygon[(index + 1) % polygon.length];
    if (ay > y !== by > y && x < ((bx - ax) * (y - ay)) / (by - ay) + ax) within = !within;
  });
  return within;
}
