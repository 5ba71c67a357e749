// Mouse and keys on the pictures: enlarge, zoom and pan; what else there is to move is for subclasses.

const CLICK = 4; // screen pixels

export class Pointer {
  // The app enlarges a camera, and its `explain` is told of the pixel under the mouse.
  constructor(app) {
    this.app = app;
    this.drag = null;
  }

  attach(view) {
    const { canvas } = view;
    canvas.addEventListener("pointerdown", (event) => this.down(view, event));
    canvas.addEventListener("pointermove", (event) => this.move(view, event));
    canvas.addEventListener("pointerup", (event) => this.up(view, event));
    canvas.addEventListener("pointercancel", () => this.cancelDrag());
    canvas.addEventListener("pointerleave", () => this.leave(view));
    canvas.addEventListener("keydown", (event) => {
      if (view.large || !["Enter", " "].includes(event.key)) return;
      event.preventDefault();
      event.stopPropagation(); // the page's keys are for the enlarged camera
      this.app.enlarge(view.name);
    });
    canvas.addEventListener("contextmenu", (event) => view.large && event.preventDefault());
    canvas.addEventListener("wheel", (event) => {
      if (!view.large) return;
      event.preventDefault();
      view.zoomAt(at(event), Math.exp(-Math.sign(event.deltaY) * 0.22));
      this.hover(view, event);
    }, { passive: false });
  }

  down(view, event) {
    if (!view.large) return;
    view.canvas.setPointerCapture(event.pointerId);
    view.measure();
    const position = at(event);
    const grabbed = event.button === 0 ? this.grab(view, position) : null;
    this.drag = { start: position, last: position, moved: false, button: event.button, grabbed };
  }

  move(view, event) {
    if (!view.large) return;
    const position = at(event);
    const { drag } = this;
    if (drag && (drag.moved || distance(position, drag.start) > CLICK)) {
      if (!drag.moved && drag.grabbed) this.hold();
      drag.moved = true;
      if (drag.grabbed) this.dragTo(view, drag.grabbed, position);
      else view.pan(position[0] - drag.last[0], position[1] - drag.last[1]);
      drag.last = position;
    }
    this.hover(view, event);
  }

  up(view, event) {
    const { drag } = this;
    this.drag = null;
    if (!view.large) {
      if (event.button === 0) this.app.enlarge(view.name);
      return;
    }
    if (!drag) return;
    if (drag.moved) {
      if (drag.grabbed) this.release();
    } else if (drag.button === 0) {
      this.click(view, at(event), event, drag.grabbed);
    }
  }

  cancelDrag() {
    if (this.drag?.moved && this.drag.grabbed) this.release();
    this.drag = null;
  }

  leave() {
    this.app.explain(null);
  }

  hover(view, event) {
    view.measure();
    const pixel = view.toPixel(at(event));
    this.app.explain(view.contains(pixel) ? { camera: view.name, pixel } : null);
  }

  // What is under the mouse and can be moved.
  grab() {
    return null;
  }

  click() {}

  // Keys while a camera is enlarged; returns whether one was understood.
  key(view, event) {
    if (event.key === "Escape") this.app.enlarge(null);
    else if (event.key === "0") view.reset();
    else return false;
    return true;
  }
}

export const at = (event) => [event.offsetX, event.offsetY];

export const distance = ([a, b], [c, d]) => Math.hypot(a - c, b - d);
