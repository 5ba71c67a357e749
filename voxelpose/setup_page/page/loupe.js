// A magnified square of the picture, to see where within a pixel something is.

const TIMES = 9;

export class Loupe {
  constructor(canvas) {
    this.canvas = canvas;
  }

  hide() {
    this.canvas.hidden = true;
  }

  // Shows what is around a pixel; the page's position of it decides on the corner.
  show(view, pixel) {
    if (!view.image) return this.hide();
    const side = this.canvas.width;
    const pen = this.canvas.getContext("2d");
    // At least nine screen pixels to one of the picture, and more than the view itself shows.
    const times = Math.max(TIMES, 3 * view.scale);
    const count = side / times;
    pen.fillStyle = "#0d0f11";
    pen.fillRect(0, 0, side, side);
    pen.imageSmoothingEnabled = false;
    pen.drawImage(
      view.image,
      pixel[0] + 0.5 - count / 2, pixel[1] + 0.5 - count / 2, count, count,
      0, 0, side, side,
    );
    pen.strokeStyle = "rgb(0 0 0 / 70%)";
    pen.lineWidth = 3;
    this.cross(pen, side);
    pen.strokeStyle = "#ffd23f";
    pen.lineWidth = 1;
    this.cross(pen, side);
    const text = `${pixel[0].toFixed(1)}, ${pixel[1].toFixed(1)}`;
    pen.font = "600 12px system-ui, sans-serif";
    pen.fillStyle = "rgb(13 15 17 / 80%)";
    pen.fillRect(0, side - 20, pen.measureText(text).width + 14, 20);
    pen.fillStyle = "#e9edf0";
    pen.fillText(text, 7, side - 6);
    this.place(view, pixel, side);
    this.canvas.hidden = false;
  }

  cross(pen, side) {
    const half = side / 2;
    pen.beginPath();
    for (const [a, b] of [[0, half - 6], [half + 6, side]]) {
      pen.moveTo(a, half);
      pen.lineTo(b, half);
      pen.moveTo(half, a);
      pen.lineTo(half, b);
    }
    pen.stroke();
  }

  // Beside the pixel, on the side where there is room.
  place(view, pixel, side) {
    const box = view.canvas.getBoundingClientRect();
    const [x, y] = view.toCanvas(pixel);
    const gap = 26;
    const left = box.left + x + (box.left + x + gap + side < box.right ? gap : -gap - side);
    const top = box.top + y + (y - gap - side > 0 ? -gap - side : gap);
    this.canvas.style.left = `${Math.min(Math.max(left, 4), innerWidth - side - 8)}px`;
    this.canvas.style.top = `${Math.min(Math.max(top, 4), innerHeight - side - 8)}px`;
  }
}
