// Answers of frames: asked for one at a time, kept up to a size, the newest need first.

const MOST_LETTERS = 2e8;

export class FrameStore {
  // `ask(frame)` gets an answer, `arrived(frame)` is told of it, `failed(text)` of what goes wrong.
  constructor(ask, arrived, failed) {
    Object.assign(this, { ask, arrived, failed, answers: new Map(), letters: 0, round: 0, busy: false, takes_s: 0.1, lost: null });
  }

  has(frame) {
    return this.answers.has(frame);
  }

  get(frame) {
    return this.answers.get(frame).answer;
  }

  forget() {
    this.answers.clear();
    this.letters = 0;
    this.round += 1;
  }

  // Wants a frame; while frames pass at a rate, the next one that is not there and can be there in
  // time, so that each round of the motion brings more of them.
  want(frame, rate, { first, count }) {
    this.wanted = null;
    const ahead = Math.ceil(this.takes_s * rate);
    for (let k = 0; k < (rate ? count : 1) && this.wanted === null; k++) {
      const next = first + ((frame - first + k + ahead) % count);
      if (!this.has(next)) this.wanted = next;
    }
    if (!this.busy) this.#work();
  }

  async #work() {
    this.busy = true;
    while (this.wanted !== null && !this.has(this.wanted)) {
      const [frame, round, began] = [this.wanted, this.round, performance.now()];
      try {
        const answer = await this.ask(frame);
        if (round !== this.round) continue;
        this.#keep(frame, answer);
        this.takes_s += 0.3 * ((performance.now() - began) / 1000 - this.takes_s);
        this.lost = null;
        this.failed("");
      } catch (error) {
        this.lost = frame;
        this.failed(error.message);
        if (this.wanted === frame) this.wanted = null;
        continue;
      }
      if (this.wanted === frame) this.wanted = null;
      this.arrived(frame);
    }
    this.busy = false;
  }

  #keep(frame, answer) {
    const letters = JSON.stringify(answer.pictures).length + JSON.stringify(answer.hull).length;
    this.answers.set(frame, { answer, letters });
    this.letters += letters;
    for (const [old, kept] of this.answers) {
      if (this.letters < MOST_LETTERS || old === frame) break;
      this.answers.delete(old);
      this.letters -= kept.letters;
    }
  }
}
