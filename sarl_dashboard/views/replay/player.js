// A film that is played, stopped and gone through in the browser, without asking the server for
// pictures. It reads the GIF that is downloaded too: every picture is there, sharp, and nothing
// has to be installed for it. Each picture of the GIF holds what changed since the one before, so
// going back begins at one of the whole pictures that are kept on the way.

const TABLE = 13; // where the colours begin
const UNCHANGED = 255; // this pixel stays as it was
const CLEAR = 256;
const END = 257;
const WHOLE = 16; // pictures from one that is kept whole to the next, at least
const MOST_WHOLE = 48;
const QUIET = 350; // milliseconds that a step is looked at before the rest of the page follows

function readGif(text) {
  const bytes = Uint8Array.from(atob(text), (sign) => sign.charCodeAt(0));
  const view = new DataView(bytes.buffer);
  const colours = new Uint32Array(256);
  for (let index = 0; index < 256; index += 1) {
    const [red, green, blue] = bytes.subarray(TABLE + 3 * index, TABLE + 3 * index + 3);
    colours[index] = ((255 << 24) | (blue << 16) | (green << 8) | red) >>> 0;
  }
  const afterBlocks = (from) => {
    let at = from;
    while (bytes[at]) at += bytes[at] + 1;
    return at + 1;
  };
  const pictures = [];
  let [at, time, delay] = [TABLE + 768, 0, 0];
  while (bytes[at] !== 0x3b) {
    if (bytes[at] === 0x21) {
      if (bytes[at + 1] === 0xf9) delay = view.getUint16(at + 4, true);
      at = afterBlocks(at + 2);
    } else {
      const [left, top, width] = [1, 3, 5].map((offset) => view.getUint16(at + offset, true));
      pictures.push({ time, left, top, width, data: at + 11 });
      time += delay;
      at = afterBlocks(at + 11);
    }
  }
  return { bytes, colours, pictures, width: view.getUint16(6, true), height: view.getUint16(8, true) };
}

// Lay what changed in a picture over the pixels of the one before (LZW).
function lay({ bytes, width }, picture, pixels) {
  const prefix = new Uint16Array(4096);
  const suffix = new Uint8Array(4096);
  const stack = new Uint8Array(4097);
  for (let code = 0; code < CLEAR; code += 1) suffix[code] = code;
  let [at, block] = [picture.data + 1, bytes[picture.data]];
  let [bits, ready, size, next, before, first] = [0, 0, 9, 258, -1, 0];
  let [place, column] = [picture.top * width + picture.left, 0];
  for (;;) {
    while (ready < size) {
      if (block === 0) {
        block = bytes[at];
        at += 1;
        if (!block) return;
      }
      bits |= bytes[at] << ready;
      at += 1;
      block -= 1;
      ready += 8;
    }
    let code = bits & ((1 << size) - 1);
    bits >>>= size;
    ready -= size;
    if (code === END) return;
    if (code === CLEAR) {
      [size, next, before] = [9, 258, -1];
      continue;
    }
    const now = code;
    let depth = 0;
    if (code >= next) {
      stack[depth] = first;
      depth += 1;
      code = before;
    }
    while (code > END) {
      stack[depth] = suffix[code];
      depth += 1;
      code = prefix[code];
    }
    first = suffix[code];
    stack[depth] = first;
    if (before >= 0 && next < 4096) {
      prefix[next] = before;
      suffix[next] = first;
      next += 1;
      if (next === 1 << size && size < 12) size += 1;
    }
    before = now;
    for (; depth >= 0; depth -= 1) {
      if (stack[depth] !== UNCHANGED) pixels[place + column] = stack[depth];
      column += 1;
      if (column === picture.width) {
        column = 0;
        place += width;
      }
    }
  }
}

class Reel {
  constructor(data) {
    this.gif = readGif(data.gif);
    this.fps = data.fps;
    this.pixels = new Uint8Array(this.gif.width * this.gif.height);
    this.at = -1;
    this.whole = new Map();
    this.every = Math.max(WHOLE, Math.ceil(this.gif.pictures.length / MOST_WHOLE));
    this.image = new ImageData(this.gif.width, this.gif.height);
  }

  // The picture of a step; equal ones are one, and above 50 a second some are left out.
  picture(step) {
    const time = Math.floor((100 * step) / this.fps + 0.5);
    const { pictures } = this.gif;
    let [low, high] = [0, pictures.length - 1];
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (pictures[middle].time <= time) low = middle;
      else high = middle - 1;
    }
    return low;
  }

  turn(step) {
    const wanted = this.picture(step);
    let near = wanted - (wanted % this.every);
    while (near > 0 && !this.whole.has(near)) near -= this.every;
    if (wanted < this.at || near > this.at) {
      if (this.whole.has(near)) this.pixels.set(this.whole.get(near));
      this.at = this.whole.has(near) ? near : -1;
    }
    while (this.at < wanted) {
      this.at += 1;
      lay(this.gif, this.gif.pictures[this.at], this.pixels);
      if (this.at % this.every === 0 && !this.whole.has(this.at)) {
        this.whole.set(this.at, this.pixels.slice());
      }
    }
    const coloured = new Uint32Array(this.image.data.buffer);
    for (let index = 0; index < coloured.length; index += 1) {
      coloured[index] = this.gif.colours[this.pixels[index]];
    }
    return this.image;
  }
}

class Player {
  constructor(root) {
    const part = (name) => root.querySelector(name);
    Object.assign(this, { root, stage: part(".stage"), place: part(".place") });
    Object.assign(this, { words: part("output"), button: part(".play"), loop: part(".loop") });
    Object.assign(this, { step: 0, speed: 1, playing: false, known: 0, report: () => {} });
    this.button.onclick = () => this.toggle();
    part(".back").onclick = () => this.move(-1);
    part(".on").onclick = () => this.move(1);
    this.place.oninput = () => this.look(Number(this.place.value));
    part("select").onchange = (event) => {
      this.speed = Number(event.target.value);
    };
    this.loop.onclick = () => {
      this.loop.setAttribute("aria-pressed", String(!this.looping));
    };
    this.stage.onclick = () => {
      this.button.focus();
      this.toggle();
    };
    root.onkeydown = (event) => this.key(event);
    this.follow = () => this.hear();
    document.addEventListener("sarl-step", this.follow);
  }

  get looping() {
    return this.loop.getAttribute("aria-pressed") === "true";
  }

  get last() {
    return this.data.pictures - 1;
  }

  // Take a film up; one that is there already goes on.
  take(data) {
    const same = this.data?.film === data.film;
    this.data = data;
    this.stage.setAttribute("aria-label", data.alt);
    if (same) return;
    this.stop();
    this.reel = new Reel(data);
    this.stage.replaceChildren(
      ...data.panels.map(([left, width]) => {
        const canvas = document.createElement("canvas");
        Object.assign(canvas, { width, height: this.reel.gif.height });
        canvas.style.maxWidth = `${width}px`;
        canvas.dataset.left = left;
        return canvas;
      }),
    );
    this.place.max = this.last;
    this.known = 0;
    this.go(0);
    this.hear();
    const still = window.matchMedia("(prefers-reduced-motion: reduce)").matches;
    if (this.step === 0 && data.begins && !still) this.start();
  }

  // Show a step.
  go(step) {
    this.step = Math.min(Math.max(step, 0), this.last);
    const image = this.reel.turn(this.step);
    for (const canvas of this.stage.children) {
      canvas.getContext("2d").putImageData(image, -Number(canvas.dataset.left), 0);
    }
    const text = `Step ${this.data.first + this.step} of ${this.data.first + this.last}`;
    this.place.value = this.step;
    this.place.setAttribute("aria-valuetext", text);
    this.words.textContent = text;
  }

  // Show a step that a person chose here, and take the rest of the page along.
  look(step) {
    this.stop();
    this.go(step);
    this.say();
  }

  move(by) {
    this.look(this.step + by);
  }

  say() {
    clearTimeout(this.waiting);
    this.waiting = setTimeout(() => {
      const step = Math.min(this.step, this.data.steps - 1);
      if (this.playing || step === this.known) return;
      this.known = step;
      this.report(step);
    }, QUIET);
  }

  // Go to the step that was chosen elsewhere on the page.
  hear() {
    const chosen = window.sarlStep;
    if (chosen?.film !== this.data.film || chosen.step === this.known) return;
    this.known = chosen.step;
    this.stop();
    this.go(chosen.step);
  }

  toggle() {
    if (this.playing) {
      this.stop();
      this.say();
    } else {
      this.start();
    }
  }

  start() {
    this.playing = true;
    this.root.classList.add("playing");
    this.button.setAttribute("aria-label", "Pause");
    this.button.title = "Pause (space)";
    let position = this.step === this.last ? 0 : this.step;
    let before = performance.now();
    const frame = (now) => {
      if (!this.playing) return;
      // A window that was hidden, or a slow machine, goes on where it was.
      position += (Math.min(Math.max(now - before, 0), 250) / 1000) * this.data.fps * this.speed;
      before = now;
      if (this.looping && position >= this.last + 1) position = 0;
      const step = Math.min(Math.floor(position), this.last);
      if (step !== this.step) this.go(step);
      if (step === this.last && !this.looping) this.stop();
      else this.next = requestAnimationFrame(frame);
    };
    this.next = requestAnimationFrame(frame);
  }

  stop() {
    this.playing = false;
    cancelAnimationFrame(this.next);
    this.root.classList.remove("playing");
    this.button.setAttribute("aria-label", "Play");
    this.button.title = "Play (space)";
  }

  key(event) {
    const on = event.target.tagName;
    if (event.ctrlKey || event.altKey || event.metaKey || on === "SELECT") return;
    // Buttons know the space bar themselves, and the slider its arrows.
    const moves = { ArrowLeft: -1, ArrowRight: 1 };
    if (event.key === " " && on !== "BUTTON") this.toggle();
    else if (event.key in moves && on !== "INPUT") this.move(moves[event.key]);
    else return;
    event.preventDefault();
  }

  end() {
    this.stop();
    clearTimeout(this.waiting);
    document.removeEventListener("sarl-step", this.follow);
  }
}

const players = new WeakMap();

export default function ({ data, parentElement, setTriggerValue }) {
  if (!players.has(parentElement)) {
    players.set(parentElement, new Player(parentElement.querySelector(".player")));
  }
  const player = players.get(parentElement);
  player.report = (step) => setTriggerValue("step", step);
  player.take(data);
  return () => {
    player.end();
    players.delete(parentElement);
  };
}
