const { layout, width, height } = about;
const { robots: R, steps: T, block: BLOCK } = layout;

/* ---- The recording ---- */

/* The run's data on the page; the counterpart of recording.rs. */
class Recording {
  constructor(bytes) {
    this.bytes = bytes;
    let at = 0;
    const numbers = (Kind, count) => {
      const end = at + count * Kind.BYTES_PER_ELEMENT;
      const part = new Kind(bytes.slice(at, end).buffer);
      at = end;
      return part;
    };
    const starts = [numbers(Uint16Array, R), numbers(Uint16Array, R), numbers(Uint8Array, R)];
    this.mispredicted = numbers(Uint32Array, T);
    this.moved = numbers(Uint32Array, T);
    this.members = numbers(Uint32Array, T + 1);
    this.starts = starts;
    this.offsets = [];
    for (let first = 0; first < T; first += BLOCK) {
      this.offsets.push(at);
      const n = Math.min(BLOCK, T - first);
      const ofSteps = layout.has_controller ? 1 : 0;
      const ofStates = layout.has_controller ? layout.prediction_bytes + 1 : 6;
      at += R * (n * ofSteps + (n + 1) * ofStates);
    }
    if (at !== bytes.length) throw new Error('the page is damaged: its data have the wrong length');
    this.keyframes = layout.has_controller ? this.findKeyframes() : [];
    this.recent = new Map();
    this.board = new Board(about.flips?.sensed);
    this.fitness = new Float64Array(T + 1);
    let missed = 0;
    for (let t = 1; t <= T; t++) {
      missed += this.mispredicted[t - 1];
      this.fitness[t] = 1 - missed / (R * about.sensors * t);
    }
  }

  /* Poses at the start of every block. */
  findKeyframes() {
    let [xs, ys, headings] = this.starts;
    return this.offsets.map((offset, block) => {
      const frame = [xs, ys, headings];
      [xs, ys, headings] = [xs.slice(), ys.slice(), headings.slice()];
      const n = Math.min(BLOCK, T - block * BLOCK);
      for (let robot = 0; robot < R; robot++) {
        let [x, y, heading] = [xs[robot], ys[robot], headings[robot]];
        let at = offset + robot * n;
        for (const end = at + n; at < end; at++) {
          const code = this.bytes[at];
          if (code & 4) {
            x = wrapped(x + about.ahead[heading][0], width);
            y = wrapped(y + about.ahead[heading][1], height);
          } else if (code & 1) {
            heading = about.turned[heading][(code >> 1) & 1];
          }
        }
        xs[robot] = x;
        ys[robot] = y;
        headings[robot] = heading;
      }
      return frame;
    });
  }

  /* The states and steps of a block, as arrays: all robots of one state, then of the next. */
  decode(block) {
    const first = block * BLOCK;
    const n = Math.min(BLOCK, T - first);
    const states = (n + 1) * R;
    const decoded = {
      first,
      n,
      xs: new Uint16Array(states),
      ys: new Uint16Array(states),
      headings: new Uint8Array(states),
      members: new Uint8Array(states),
      predicted: layout.has_controller ? new Uint16Array(states) : null,
      moves: layout.has_controller ? new Uint8Array(n * R) : null,
    };
    const bytes = this.bytes;
    let at = this.offsets[block];
    const plane = (target, shift) => {
      for (let robot = 0; robot < R; robot++) {
        let value = 0;
        for (let s = 0, to = robot; s <= n; s++, to += R) {
          value ^= bytes[at++];
          target[to] |= value << shift;
        }
      }
    };
    const { xs, ys, headings } = decoded;
    if (layout.has_controller) {
      const frame = this.keyframes[block];
      for (let robot = 0; robot < R; robot++) {
        let [x, y, heading] = [frame[0][robot], frame[1][robot], frame[2][robot]];
        for (let s = 0, to = robot; ; s++, to += R) {
          xs[to] = x;
          ys[to] = y;
          headings[to] = heading;
          if (s === n) break;
          const code = bytes[at++];
          decoded.moves[to] = code;
          if (code & 4) {
            x = wrapped(x + about.ahead[heading][0], width);
            y = wrapped(y + about.ahead[heading][1], height);
          } else if (code & 1) {
            heading = about.turned[heading][(code >> 1) & 1];
          }
        }
      }
      for (let i = 0; i < layout.prediction_bytes; i++) plane(decoded.predicted, 8 * i);
    } else {
      for (const [target, shift] of [[xs, 0], [xs, 8], [ys, 0], [ys, 8], [headings, 0]]) {
        plane(target, shift);
      }
    }
    plane(decoded.members, 0);
    return decoded;
  }

  /* The block that contains a state, and the state's offset in its arrays. */
  at(t) {
    const block = Math.min(Math.floor(t / BLOCK), this.offsets.length - 1);
    let decoded = this.recent.get(block);
    if (!decoded) {
      decoded = this.decode(block);
      if (this.recent.size >= 4) this.recent.delete(this.recent.keys().next().value);
      this.recent.set(block, decoded);
    }
    return { block: decoded, from: (t - decoded.first) * R };
  }

  /* The readings of all robots in step t; null after the last step and for trajectories. */
  sensed(t) {
    if (!layout.has_controller || t >= T) return null;
    if (this.sensedOf !== t) {
      const { block, from } = this.at(t);
      this.readings = this.board.sense(block, from, this.readings);
      this.sensedOf = t;
    }
    return this.readings;
  }
}

const wrapped = (at, side) => (at < 0 ? at + side : at >= side ? at - side : at);

/* The occupied cells. Noise flips only the bits in `flipped`. */
class Board {
  constructor(flipped) {
    this.cells = new Uint8Array(width * height);
    this.noise = about.flips ? new Noise(about.flips, flipped) : null;
  }

  /* The readings of all robots in a state, including noise. */
  sense({ first, xs, ys, headings }, from, readings = new Uint16Array(R)) {
    const { cells } = this;
    for (let i = from; i < from + R; i++) cells[ys[i] * width + xs[i]] = 1;
    for (let robot = 0; robot < R; robot++) {
      const i = from + robot;
      const offsets = about.offsets[headings[i]];
      let bits = 0;
      for (let sensor = 0; sensor < offsets.length; sensor++) {
        // A side of the grid may be shorter than two cells.
        const x = wrapped(xs[i] + offsets[sensor][0], width);
        const y = wrapped(ys[i] + offsets[sensor][1], height);
        bits |= cells[y * width + x] << sensor;
      }
      readings[robot] = bits;
    }
    if (this.noise) this.noise.flip(first + from / R, readings);
    for (let i = from; i < from + R; i++) cells[ys[i] * width + xs[i]] = 0;
    return readings;
  }
}

/* The noise of noise.rs: ChaCha8 with the step as its stream; each robot takes half a block. */
class Noise {
  constructor({ key, per_65536 }, flipped) {
    this.below = per_65536;
    this.flipped = flipped;
    this.start = Int32Array.of(0x61707865, 0x3320646e, 0x79622d32, 0x6b206574, ...key, 0, 0, 0, 0);
    this.words = new Int32Array(16);
  }

  /* Flips bits in the readings of all robots in a step. */
  flip(step, readings) {
    this.start[14] = step;
    for (let robot = 0; robot < R; robot++) {
      if (robot % 2 === 0) this.draw(robot / 2);
      readings[robot] ^= this.half(8 * (robot % 2)) & this.flipped;
    }
  }

  draw(block) {
    const { start, words } = this;
    start[12] = block;
    words.set(start);
    for (let round = 0; round < 8; round += 2) {
      for (let i = 0; i < 4; i++) quarterRound(words, i, 4 + i, 8 + i, 12 + i);
      for (let i = 0; i < 4; i++) quarterRound(words, i, 4 + ((i + 1) % 4), 8 + ((i + 2) % 4), 12 + ((i + 3) % 4));
    }
    for (let i = 0; i < 16; i++) words[i] += start[i];
  }

  half(from) {
    let flips = 0;
    for (let pair = 0; pair < 8; pair++) {
      const word = this.words[from + pair];
      if ((word & 0xffff) < this.below) flips |= 1 << (2 * pair);
      if (word >>> 16 < this.below) flips |= 2 << (2 * pair);
    }
    return flips;
  }
}

function quarterRound(words, a, b, c, d) {
  words[a] += words[b];
  words[d] = rotated(words[d] ^ words[a], 16);
  words[c] += words[d];
  words[b] = rotated(words[b] ^ words[c], 12);
  words[a] += words[b];
  words[d] = rotated(words[d] ^ words[a], 8);
  words[c] += words[d];
  words[b] = rotated(words[b] ^ words[c], 7);
}

const rotated = (word, by) => (word << by) | (word >>> (32 - by));

/* ---- The scene: the rules of scene.rs ---- */

let recording = null;

function scene(t, colouring, picked) {
  const { block, from } = recording.at(t);
  const sensed = colouring === 'surprise' || picked !== null ? recording.sensed(t) : null;
  const named = about.named === null ? 0 : 1 << about.named;
  const robots = [];
  for (let robot = 0; robot < R; robot++) {
    const i = from + robot;
    let ink = 'plain';
    if (colouring === 'structure') {
      const members = block.members[i];
      ink = members & named ? 'named' : members ? 'other' : 'outside';
    } else if (colouring === 'surprise' && sensed) {
      const missed = ones(sensed[robot] ^ block.predicted[i]);
      ink = { surprise: missed === 0 ? 0 : 8 * missed <= about.sensors ? 1 : 4 * missed <= about.sensors ? 2 : 3 };
    }
    robots.push({ x: block.xs[i], y: block.ys[i], heading: block.headings[i], ink });
  }
  const within = picked !== null && picked >= 0 && picked < R ? picked : null;
  return { width, height, robots, marks: within === null ? [] : marks(t, within, sensed), area: about.area, picked: within };
}

function marks(t, robot, sensed) {
  if (!layout.has_controller) return [];
  const { block, from } = recording.at(t);
  const i = from + robot;
  return about.offsets[block.headings[i]].map(([dx, dy], sensor) => {
    const predicted = (block.predicted[i] >> sensor) & 1;
    const suffix = (bit) => (bit ? 'occupied' : 'empty');
    let mark = 'expects-' + suffix(predicted);
    if (sensed) {
      const bit = (sensed[robot] >> sensor) & 1;
      mark = (bit === predicted ? 'hit-' : 'miss-') + suffix(bit);
    }
    return { x: wrapped(block.xs[i] + dx, width), y: wrapped(block.ys[i] + dy, height), mark };
  });
}

function ones(bits) {
  let count = 0;
  for (; bits; bits &= bits - 1) count++;
  return count;
}

/* ---- The check: the hash chain of steps_hash.rs ---- */

const check = { status: 'waiting', computed: null, compared: null, done: 0 };

async function checkSteps() {
  const [sign, text, line] = [element('check-sign'), element('check-text'), element('check')];
  const say = (status, mark, words, kind = '') => {
    check.status = status;
    sign.textContent = mark;
    text.textContent = words;
    line.className = kind;
  };
  if (!layout.has_controller) {
    return say('no hash', '–', 'Not verified: a trajectory has poses only and no hash.');
  }
  if (!(globalThis.crypto && crypto.subtle)) {
    return say('unchecked', '–', 'Not verified: this browser offers no SHA-256 to pages opened as files.');
  }
  check.compared = about.recorded_hash || about.computed_hash;
  const digest = async (bytes) => new Uint8Array(await crypto.subtle.digest('SHA-256', bytes));
  const prefix = new TextEncoder().encode(about.hash_start);
  const start = new Uint8Array(prefix.length + 8 + 5 * R);
  start.set(prefix);
  new DataView(start.buffer).setUint32(prefix.length, R, true);
  const [xs, ys, headings] = recording.starts;
  for (let robot = 0, at = prefix.length + 8; robot < R; robot++) {
    at = putPose(start, at, xs[robot], ys[robot], headings[robot]);
  }
  let hash = await digest(start);
  const step = new Uint8Array(32 + 11 * R);
  const board = new Board(about.flips?.hashed);
  const readings = new Uint16Array(R);
  let rested = performance.now();
  for (let number = 0; number < recording.offsets.length; number++) {
    const block = recording.decode(number);
    for (let s = 0; s < block.n; s++) {
      board.sense(block, s * R, readings);
      step.set(hash);
      for (let robot = 0, at = 32; robot < R; robot++) {
        const [now, after] = [s * R + robot, (s + 1) * R + robot];
        step[at++] = readings[robot];
        step[at++] = readings[robot] >> 8;
        step[at++] = block.moves[now] & 1;
        step[at++] = (block.moves[now] >> 1) & 1;
        step[at++] = block.predicted[after];
        step[at++] = block.predicted[after] >> 8;
        at = putPose(step, at, block.xs[after], block.ys[after], block.headings[after]);
      }
      hash = await digest(step);
      check.done++;
      if (performance.now() - rested > 8) {
        // Screen readers announce the progress at most ten times.
        const words = `Checking the steps: ${10 * Math.floor((10 * check.done) / T)} %`;
        if (T > 2000 && text.textContent !== words) text.textContent = words;
        await new Promise((resume) => setTimeout(resume));
        rested = performance.now();
      }
    }
  }
  check.computed = Array.from(hash, (byte) => byte.toString(16).padStart(2, '0')).join('');
  element('page-hash').textContent = check.computed;
  if (check.computed !== check.compared) {
    say('bad', '✗', about.recorded_hash
      ? 'The steps shown here are not those of the recorded run: their hashes differ.'
      : 'The steps shown here are not those that the program computed: their hashes differ.', 'bad');
  } else if (about.recorded_hash) {
    say('good', '✓', 'Verified: identical to the recorded run.', 'good');
  } else {
    say('good', '✓', 'Verified: identical to the run that the program computed; this run recorded no hash.', 'good');
  }
}

function putPose(bytes, at, x, y, heading) {
  bytes[at++] = x;
  bytes[at++] = x >> 8;
  bytes[at++] = y;
  bytes[at++] = y >> 8;
  bytes[at++] = heading;
  return at;
}

/* ---- Drawing ---- */

const SPEEDS = [1, 2, 5, 10, 20, 40, 80, 160, 320];
const COLOURINGS = ['structure', 'surprise', 'plain'];
const HEADINGS = ['east', 'north', 'west', 'south'];
const state = { t: 0, playing: false, speed: 20, colouring: about.colouring, picked: null, frames: 0, opened: null };
const structure = about.named === null ? null : about.structures[about.named];

const swarm = element('swarm');
const context = swarm.getContext('2d');
let ground = null;
let side = 1;

const percent = (part) => `${Math.round(100 * part)} %`;
const rounded = (number) => number.toFixed(3);

function drawSwarm(context, shown, side) {
  context.globalAlpha = 0.22;
  context.fillStyle = colours.expects;
  for (const [x, y] of shown.area) context.fillRect(x * side, (height - 1 - y) * side, side, side);
  context.globalAlpha = 1;
  for (const { x, y, mark } of shown.marks) drawMark(context, x * side, (height - 1 - y) * side, side, mark);
  drawRobots(context, shown.robots, height, side);
  if (shown.picked !== null) {
    const { x, y } = shown.robots[shown.picked];
    const line = Math.max(1.5, side / 12);
    context.strokeStyle = colours.text;
    context.lineWidth = line;
    context.beginPath();
    context.arc((x + 0.5) * side, (height - 0.5 - y) * side, Math.max(3, 0.62 * side), 0, 7);
    context.stroke();
  }
}

/* Hits are squares, misses are crosses, expectations are rings; thick or filled for a robot. */
function drawMark(context, left, top, side, mark) {
  const [kind, what] = mark.split('-');
  const thick = what === 'occupied';
  context.strokeStyle = context.fillStyle = colours[kind === 'expects' ? 'expects' : kind];
  const inset = Math.max(1.5, side * 0.08);
  const size = side - 2 * inset;
  context.lineWidth = Math.max(1, side * (thick ? 0.1 : 0.045));
  context.globalAlpha = thick ? 0.3 : 0.1;
  context.fillRect(left + 1, top + 1, side - 1, side - 1);
  context.globalAlpha = 1;
  context.beginPath();
  if (kind === 'hit') {
    context.rect(left + inset, top + inset, size, size);
  } else if (kind === 'miss') {
    context.moveTo(left + inset, top + inset);
    context.lineTo(left + side - inset, top + side - inset);
    context.moveTo(left + side - inset, top + inset);
    context.lineTo(left + inset, top + side - inset);
  } else {
    context.arc(left + side / 2, top + side / 2, size / 2, 0, 7);
  }
  context.stroke();
}

let waiting = false;
function redraw() {
  if (waiting || !recording) return;
  waiting = true;
  requestAnimationFrame(() => {
    waiting = false;
    draw();
  });
}

function draw() {
  const shown = scene(state.t, state.colouring, state.picked);
  context.drawImage(ground, 0, 0);
  drawSwarm(context, shown, side);
  state.frames++;
  element('seek').value = state.t;
  element('seek').setAttribute('aria-valuetext', `state ${state.t} of ${T}`);
  element('time').innerHTML = `<b>${state.t}</b> of ${T}`;
  for (const curve of curves) curve.mark(state.t);
  showWorldModel(shown);
  if (about.damage) small('now', shown.robots);
  if (!state.playing) announce();
}

let announced = 0;
function announce() {
  clearTimeout(announced);
  announced = setTimeout(() => {
    if (!state.playing) element('status').textContent = spoken();
  }, 150);
}

function spoken() {
  const parts = [`State ${state.t} of ${T}`];
  if (layout.has_controller && state.t > 0) parts.push(`fitness so far ${rounded(recording.fitness[state.t])}`);
  if (structure) parts.push(`${recording.members[state.t]} of ${R} robots in ${structure}`);
  if (state.picked !== null) parts.push(element('world-model-text').textContent);
  return parts.join('. ');
}

/* ---- The world model of the selected robot ---- */

const SVG = 'http://www.w3.org/2000/svg';
function svg(parent, name, attributes = {}) {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  parent.append(made);
  return made;
}

const views = {};
function makeViews() {
  if (!layout.has_controller) return;
  const reach = Math.max(...about.cells.map(([ahead]) => Math.abs(ahead)));
  for (const [name, words] of [['predicted', 'predicted'], ['sensed', 'sensed'], ['next', 'predicts next']]) {
    const figure = document.createElement('figure');
    const picture = svg(figure, 'svg', { viewBox: `-1.6 ${-reach - 0.6} 3.2 ${2 * reach + 1.2}`, role: 'img' });
    const spots = about.cells.map(([ahead, left]) => {
      const group = svg(picture, 'g', { transform: `translate(${-left} ${-ahead})` });
      svg(group, 'rect', { class: 'spot', x: -0.43, y: -0.43, width: 0.86, height: 0.86, rx: 0.08 });
      svg(group, 'path', { class: 'cross', d: 'M-.25 -.25L.25 .25M.25 -.25L-.25 .25' });
      return group;
    });
    const outline = arrows[1].map(([x, y]) => `${x - 0.5} ${y - 0.5}`).join('L');
    svg(picture, 'path', { class: 'self', d: `M${outline}Z` });
    const caption = document.createElement('figcaption');
    caption.textContent = words;
    figure.append(caption);
    element('views').lastElementChild.before(figure);
    views[name] = { picture, spots };
  }
}

function setView(name, bits, kind) {
  const { picture, spots } = views[name];
  spots.forEach((spot, sensor) => {
    const occupied = bits !== null && (bits >> sensor) & 1;
    spot.setAttribute('class', `${kind(sensor)}${occupied ? ' occupied' : ''}`);
  });
  const seen = about.cells.filter((_, sensor) => bits !== null && (bits >> sensor) & 1);
  const places = seen.map(([ahead, left]) => {
    const along = ahead > 0 ? `${ahead} ahead` : ahead < 0 ? `${-ahead} behind` : '';
    const across = left > 0 ? 'left' : left < 0 ? 'right' : '';
    return [along, across].filter(Boolean).join(' ');
  });
  picture.setAttribute('aria-label', bits === null ? 'nothing' : places.length ? `robots ${places.join(', ')}` : 'no robots');
}

let shownModel = null;
function showWorldModel(shown) {
  const { picked } = shown;
  const key = `${picked} ${state.t}`;
  if (shownModel === key) return;
  shownModel = key;
  element('views').hidden = picked === null || !layout.has_controller;
  if (document.activeElement !== element('robot')) element('robot').value = picked === null ? '' : picked;
  if (picked === null) {
    element('world-model-text').textContent = layout.has_controller
      ? 'Select a robot with the mouse or with N to see what it predicts and senses.'
      : 'A trajectory has poses only: what its robots sense and predict is unknown.';
    return;
  }
  const { block, from } = recording.at(state.t);
  const members = block.members[from + picked];
  const names = about.structures.filter((_, bit) => (members >> bit) & 1);
  const { x, y, heading } = shown.robots[picked];
  let text = `Robot ${picked} at ${x}, ${y}, facing ${HEADINGS[heading]}, in ${names.join(' and ') || 'no structure'}. `;
  if (layout.has_controller) {
    const predicted = block.predicted[from + picked];
    const sensed = recording.sensed(state.t);
    if (sensed) {
      const wrong = sensed[picked] ^ predicted;
      const kind = (sensor) => ((wrong >> sensor) & 1 ? 'miss' : 'hit');
      setView('predicted', predicted, () => '');
      setView('sensed', sensed[picked], kind);
      const after = recording.at(state.t + 1);
      setView('next', after.block.predicted[after.from + picked], () => 'expects');
      text += `${about.sensors - ones(wrong)} of ${about.sensors} sensors predicted correctly.`;
    } else {
      setView('predicted', predicted, () => 'expects');
      setView('sensed', null, () => '');
      setView('next', null, () => '');
      text += 'The run ends before it senses.';
    }
  }
  element('world-model-text').textContent = text;
}

/* ---- Curves ---- */

const curves = [];
/* A curve over the states: drawn once per size and theme; only its mark moves. */
function addCurve(name, values, top, shown, ink, states = true) {
  const box = document.createElement('div');
  box.className = 'curve';
  box.innerHTML = '<div class="row"><span></span><b></b></div><div class="plot"><canvas role="img"></canvas><div class="mark"></div></div>';
  const [label, value, plot, canvas, mark] = ['span', 'b', '.plot', 'canvas', '.mark'].map((part) => box.querySelector(part));
  label.textContent = name;
  canvas.setAttribute('aria-label', `${name}, from ${shown(values[0])} to ${shown(values[values.length - 1])}`);
  element('curves').append(box);
  const last = values.length - 1;
  const place = (t) => (last ? Math.min(t, last) / last : 0);
  if (states) {
    const seekTo = (event) => {
      const area = plot.getBoundingClientRect();
      seek(Math.round(((event.clientX - area.left) / area.width) * last));
    };
    plot.addEventListener('pointerdown', seekTo);
    plot.addEventListener('pointermove', (event) => event.buttons & 1 && seekTo(event));
  } else {
    plot.style.cursor = 'default';
    mark.remove();
    value.textContent = shown(values[last]);
  }
  curves.push({
    draw() {
      const scale = window.devicePixelRatio || 1;
      const [across, down] = [Math.round(canvas.clientWidth * scale), Math.round(canvas.clientHeight * scale)];
      [canvas.width, canvas.height] = [across, down];
      const pen = canvas.getContext('2d');
      pen.fillStyle = colours.cell;
      pen.fillRect(0, 0, across, down);
      pen.fillStyle = colours.line;
      for (const part of [0.25, 0.5, 0.75]) pen.fillRect(0, Math.round(down * part), across, 1);
      pen.strokeStyle = colours[ink];
      pen.lineWidth = 1.5 * scale;
      pen.lineJoin = 'round';
      pen.beginPath();
      // If there are more states than pixels, each pixel shows a minimum and a maximum.
      const height = (number) => down - 1 - (number / top) * (down - 2);
      const bins = Math.max(1, Math.min(last, across));
      for (let bin = 0; bin <= bins; bin++) {
        const from = Math.round((bin / bins) * last);
        const to = Math.max(from + 1, Math.min(last + 1, Math.round(((bin + 1) / bins) * last)));
        let [low, high] = [values[from], values[from]];
        for (let i = from + 1; i < to; i++) {
          low = Math.min(low, values[i]);
          high = Math.max(high, values[i]);
        }
        const x = (bin / bins) * across;
        if (bin) pen.lineTo(x, height(high));
        else pen.moveTo(x, height(high));
        if (low < high) pen.lineTo(x, height(low));
      }
      pen.stroke();
    },
    mark(t) {
      if (!states) return;
      mark.style.left = `${100 * place(t)}%`;
      value.textContent = shown(values[Math.min(t, last)]);
    },
  });
}

/* ---- Text ---- */

function makeWords() {
  document.title = about.title;
  if (about.gallery) {
    element('gallery').href = about.gallery;
    element('up').hidden = false;
  }
  element('title').textContent = about.title;
  const facts = [];
  if (structure) facts.push(`${percent(recording.members[T] / R)} of ${R} robots`);
  else facts.push(`${R} robots`);
  if (layout.has_controller) facts.push(`fitness ${rounded(recording.fitness[T])}`);
  facts.push(`${about.grid.replace('x', ' × ')} torus`);
  if (about.model) facts.push(`sensor model ${about.model}`, `predictions ${about.prediction}`);
  if (about.noise > 0) facts.push(`noise ${about.noise}`);
  if (about.seed !== null) facts.push(`seed ${about.seed}`);
  if (about.run_hash) facts.push(`run ${about.run_hash.slice(0, 8)}`);
  if (about.damage) facts.push(about.damage.done === 'remove' ? 'robots removed' : 'robots repositioned');
  element('facts').textContent = facts.join(' · ');
  const hashes = [['run', about.source], ['hash of the run', about.run_hash],
    ['hash of the steps, recorded', about.recorded_hash], ['hash of the steps, computed', about.computed_hash]];
  const list = document.createElement('dl');
  const entry = (name, value, id) => {
    const [term, text] = [document.createElement('dt'), document.createElement('dd')];
    [term.textContent, text.textContent] = [name, value];
    if (id) text.id = id;
    list.append(term, text);
  };
  for (const [name, value] of hashes) if (value) entry(name, value);
  if (layout.has_controller) entry('hash of the steps on this page', '…', 'page-hash');
  element('hashes').append(list);
}

function makeLegend() {
  const inks = {
    structure: [['named', structure], ['other', 'another structure'], ['outside', 'none']],
    surprise: [['surprise-0', 'no sensor mispredicted'], ['surprise-1', 'up to an eighth'], ['surprise-2', 'up to a quarter'], ['surprise-3', 'more']],
    plain: [],
  }[state.colouring];
  const legend = element('legend');
  legend.textContent = '';
  for (const [ink, words] of inks) {
    if (!words) continue;
    const item = document.createElement('span');
    const canvas = document.createElement('canvas');
    const scale = window.devicePixelRatio || 1;
    canvas.width = canvas.height = 18 * scale;
    canvas.style.width = canvas.style.height = '18px';
    const level = ink.startsWith('surprise-') ? { surprise: Number(ink.slice(9)) } : ink;
    drawRobots(canvas.getContext('2d'), [{ x: 0, y: 0, heading: 0, ink: level }], 1, 18 * scale);
    item.append(canvas, words);
    legend.append(item);
  }
}

/* ---- Damage ---- */

function small(id, robots) {
  const canvas = element(id);
  const across = element('pair').clientWidth / 2 - 12;
  const side = fitCanvas(canvas, width, height, across, across);
  const pen = canvas.getContext('2d');
  drawCells(pen, width, height, side);
  drawSwarm(pen, { robots, marks: [], area: about.area, picked: null }, side);
}

function showBefore() {
  if (!about.damage) return;
  element('damage').hidden = false;
  element('damage-title').textContent = about.damage.done === 'remove'
    ? 'Robots removed from the shaded area' : 'Robots repositioned from the shaded area';
  small('before', about.damage.before.map(([x, y, heading]) => ({ x, y, heading, ink: 'plain' })));
}

/* ---- Controls ---- */

function seek(t) {
  state.t = Math.max(0, Math.min(T, t));
  // Immediately: the slider's own keys continue from this value.
  element('seek').value = state.t;
  elapsed = 0;
  redraw();
}

let elapsed = 0;
let before = 0;
function play() {
  if (state.playing) return;
  if (state.t === T) state.t = 0;
  state.playing = true;
  elapsed = 0;
  before = performance.now();
  showPlaying();
  requestAnimationFrame(tick);
}

function pause() {
  state.playing = false;
  showPlaying();
  redraw();
}

function tick(now) {
  if (!state.playing) return;
  // After being hidden, the page continues without skipping steps.
  elapsed += Math.max(0, Math.min(250, now - before)) * state.speed / 1000;
  before = now;
  const steps = Math.floor(elapsed);
  if (steps > 0) {
    elapsed -= steps;
    state.t = Math.min(T, state.t + steps);
    draw();
  }
  if (state.t === T) pause();
  else requestAnimationFrame(tick);
}

function showPlaying() {
  element('play').setAttribute('aria-label', state.playing ? 'Pause' : 'Play');
  element('play-shape').setAttribute('d', state.playing ? 'M3 2h4v12H3zM9 2h4v12H9z' : 'M3 1l11 7-11 7z');
}

function setSpeed(speed) {
  state.speed = speed;
  element('speed').value = String(speed);
}

function nextSpeed(by) {
  const at = SPEEDS.indexOf(state.speed) + by;
  setSpeed(SPEEDS[Math.max(0, Math.min(SPEEDS.length - 1, at))]);
}

function setColouring(colouring) {
  state.colouring = colouring;
  element('colouring').value = colouring;
  makeLegend();
  redraw();
}

function pick(robot) {
  state.picked = robot;
  redraw();
}

function pickNext(by) {
  pick(state.picked === null ? (by > 0 ? 0 : R - 1) : (state.picked + by + R) % R);
}

/* Draws everything again for a new size or theme. */
let laidOut = '';
function layOut(again = false) {
  if (!recording) return;
  const size = [element('stage').clientWidth, window.innerHeight, window.devicePixelRatio].join();
  if (again !== true && size === laidOut) return;
  laidOut = size;
  // As large as possible with the controls still in view.
  const room = Math.max(300, window.innerHeight - element('frame').offsetTop - 160);
  side = fitCanvas(swarm, width, height, element('stage').clientWidth, room);
  ground = document.createElement('canvas');
  [ground.width, ground.height] = [swarm.width, swarm.height];
  drawCells(ground.getContext('2d'), width, height, side);
  for (const curve of curves) curve.draw();
  makeLegend();
  showBefore();
  redraw();
}

function listen() {
  const clicks = { back: () => { pause(); seek(state.t - 1); }, forward: () => { pause(); seek(state.t + 1); },
    play: () => (state.playing ? pause() : play()), previous: () => pickNext(-1), next: () => pickNext(1), none: () => pick(null) };
  for (const [id, action] of Object.entries(clicks)) element(id).addEventListener('click', action);
  element('seek').addEventListener('input', (event) => { pause(); seek(Number(event.target.value)); });
  element('speed').addEventListener('change', (event) => setSpeed(Number(event.target.value)));
  element('colouring').addEventListener('change', (event) => setColouring(event.target.value));
  element('robot').addEventListener('input', (event) => {
    const robot = event.target.value === '' ? null : Number(event.target.value);
    if (robot === null || (Number.isInteger(robot) && robot >= 0 && robot < R)) pick(robot);
  });
  swarm.addEventListener('click', (event) => {
    const box = swarm.getBoundingClientRect();
    const x = Math.floor(((event.clientX - box.left) / box.width) * width);
    const y = height - 1 - Math.floor(((event.clientY - box.top) / box.height) * height);
    const { block, from } = recording.at(state.t);
    let found = null;
    for (let robot = 0; robot < R; robot++) {
      if (block.xs[from + robot] === x && block.ys[from + robot] === y) found = robot;
    }
    pick(found === state.picked ? null : found);
  });
  document.addEventListener('keydown', (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const { target, key } = event;
    if (key === 'Escape') return pick(null);
    if (target.matches('select, input[type=number]')) return;
    const slider = target.matches('input[type=range]');
    const actions = {
      ArrowLeft: slider ? null : clicks.back,
      ArrowRight: slider ? null : clicks.forward,
      Home: slider ? null : () => { pause(); seek(0); },
      End: slider ? null : () => { pause(); seek(T); },
      ' ': target.matches('button') ? null : clicks.play,
      '+': () => nextSpeed(1), '=': () => nextSpeed(1), '-': () => nextSpeed(-1), '−': () => nextSpeed(-1),
      n: clicks.next, ']': clicks.next, p: clicks.previous, '[': clicks.previous,
      c: () => setColouring(COLOURINGS[(COLOURINGS.indexOf(state.colouring) + 1) % COLOURINGS.length]),
      t: () => element('theme').click(),
    };
    const action = actions[key.length === 1 ? key.toLowerCase() : key];
    if (!action) return;
    event.preventDefault();
    action();
  });
  new ResizeObserver(layOut).observe(element('stage'));
  window.addEventListener('resize', layOut);
}

/* Links can select a state: page.html#t=120&robot=4&colours=surprise */
function readAddress() {
  const given = new URLSearchParams(location.hash.slice(1));
  const number = (name, most) => {
    const value = given.get(name);
    return /^\d+$/.test(value || '') && Number(value) <= most ? Number(value) : null;
  };
  state.t = number('t', T) ?? 0;
  state.picked = number('robot', R - 1);
  if (COLOURINGS.includes(given.get('colours'))) state.colouring = given.get('colours');
  element('colouring').value = state.colouring;
}

async function open() {
  const text = element('data');
  recording = new Recording(await unpacked(text.textContent));
  text.remove();
  makeWords();
  makeViews();
  swarm.setAttribute('aria-label', `${R} robots on a torus of ${about.grid.replace('x', ' by ')} cells`);
  element('seek').max = T;
  element('robot').max = R - 1;
  for (const speed of SPEEDS) element('speed').add(new Option(`${speed} / s`, String(speed)));
  setSpeed(state.speed);
  element('colouring').value = state.colouring;
  const temperature = Float64Array.from(recording.moved, (moved) => moved / R);
  if (layout.has_controller) {
    const fitness = recording.fitness.slice();
    fitness[0] = fitness[1];
    addCurve('Fitness so far', fitness, 1, rounded, 'text');
  }
  addCurve('Temperature', temperature, 1, (value) => value.toFixed(2), 'other');
  if (structure) addCurve(`Robots in ${structure}`, recording.members, R, String, 'named');
  if (about.evolution.length > 1) addCurve('Best fitness of the evolution', about.evolution, 1, rounded, 'soft', false);
  listen();
  readAddress();
  onTheme(element('theme'), () => layOut(true));
  draw();
  state.opened = performance.now();
  // The check runs in the background.
  setTimeout(() => checkSteps().catch((error) => {
    check.status = 'failed';
    element('check-text').textContent = `The steps cannot be checked: ${error.message}`;
  }));
}

window.replay = {
  scene, seek, play, pause, pick,
  setColouring, setSpeed,
  state: () => ({ ...state, check: { ...check } }),
  fitness: (t) => recording.fitness[t],
  ready: open().catch((error) => {
    element('failure').hidden = false;
    element('failure').textContent = `This page cannot be shown: ${error.message}.`;
    element('main').hidden = true;
    throw error;
  }),
};
