const about = JSON.parse(document.getElementById('about').textContent);
const element = (id) => document.getElementById(id);

/* Unpacks base64 of zlib data into bytes. */
async function unpacked(text) {
  if (typeof DecompressionStream === 'undefined') {
    throw new Error('this browser cannot unpack the page; browsers since 2023 can');
  }
  let packed;
  if (Uint8Array.fromBase64) {
    packed = Uint8Array.fromBase64(text);
  } else {
    const letters = atob(text);
    packed = new Uint8Array(letters.length);
    for (let i = 0; i < letters.length; i++) packed[i] = letters.charCodeAt(i);
  }
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream('deflate'));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/* The colours of the current theme, by name. */
let colours = {};
function readColours() {
  const style = getComputedStyle(document.documentElement);
  const names = ['ground', 'cell', 'line', 'text', 'soft', 'plain', 'named', 'other', 'outside',
    'surprise-0', 'surprise-1', 'surprise-2', 'surprise-3', 'hit', 'miss', 'expects'];
  colours = Object.fromEntries(names.map((name) => [name, style.getPropertyValue('--' + name).trim()]));
}
readColours();

/* Calls back whenever the button or the system changes the theme. */
function onTheme(button, changed) {
  const root = document.documentElement;
  const system = matchMedia('(prefers-color-scheme: dark)');
  const isDark = () => (root.dataset.theme ? root.dataset.theme === 'dark' : system.matches);
  const show = () => {
    readColours();
    button.textContent = isDark() ? 'Light' : 'Dark';
    button.setAttribute('aria-label', isDark() ? 'Light theme' : 'Dark theme');
    changed();
  };
  button.addEventListener('click', () => {
    root.dataset.theme = isDark() ? 'light' : 'dark';
    show();
  });
  system.addEventListener('change', show);
  show();
}

/* The arrow for each heading, rotated about the middle of its cell; y points south. */
const arrows = [0, 1, 2, 3].map((heading) => about.arrow.map(([x, y]) => {
  let [u, v] = [x - 0.5, y - 0.5];
  for (let i = 0; i < heading; i++) [u, v] = [v, -u];
  return [u + 0.5, v + 0.5];
}));

const inkName = (ink) => (typeof ink === 'string' ? ink : 'surprise-' + ink.surprise);
/* Shapes for readers who cannot tell the colours apart: a hole in the middle, a ring around. */
const PIERCED = new Set(['other', 'surprise-1']);
const RINGED = new Set(['surprise-3']);

/* Draws robots, grouped by ink, in cells of `side` pixels. */
function drawRobots(context, robots, height, side) {
  const inks = new Map();
  for (const robot of robots) {
    const name = inkName(robot.ink);
    if (!inks.has(name)) inks.set(name, []);
    inks.get(name).push(robot);
  }
  for (const [name, group] of inks) {
    context.fillStyle = context.strokeStyle = colours[name];
    context.beginPath();
    for (const { x, y, heading } of group) {
      const [left, top] = [x * side, (height - 1 - y) * side];
      if (side < 5) {
        context.rect(left, top, side, side);
        continue;
      }
      arrows[heading].forEach(([u, v], i) => {
        if (i) context.lineTo(left + u * side, top + v * side);
        else context.moveTo(left + u * side, top + v * side);
      });
      context.closePath();
    }
    if (side >= 5) {
      context.lineJoin = 'round';
      context.lineWidth = Math.max(1, side / 15);
      context.stroke();
      if (about.hollow[name]) continue;
    }
    context.fill();
    if (side < 8 || !(PIERCED.has(name) || RINGED.has(name))) continue;
    const pierced = PIERCED.has(name);
    context.beginPath();
    for (const { x, y, heading } of group) {
      const [ahead, up] = [[1, 0], [0, -1], [-1, 0], [0, 1]][heading];
      const on = pierced ? 0.03 : 0;
      const centre = [(x + 0.5 + on * ahead) * side, (height - 0.5 - y + on * up) * side];
      const radius = side * (pierced ? 0.1 : 0.46);
      context.moveTo(centre[0] + radius, centre[1]);
      context.arc(centre[0], centre[1], radius, 0, 7);
    }
    if (pierced) {
      context.fillStyle = colours.cell;
      context.fill();
    } else {
      context.lineWidth = Math.max(1, side / 26);
      context.stroke();
    }
  }
}

/* Sets the size of a canvas in screen pixels; cells are whole pixels. */
function fitCanvas(canvas, width, height, across, down) {
  const scale = window.devicePixelRatio || 1;
  const side = Math.max(1, Math.floor(Math.min((across * scale) / width, (down * scale) / height)));
  canvas.width = side * width;
  canvas.height = side * height;
  canvas.style.width = canvas.width / scale + 'px';
  canvas.style.height = canvas.height / scale + 'px';
  return side;
}

/* Empty cells, with lines between them if they are large enough. */
function drawCells(context, width, height, side) {
  context.fillStyle = colours.cell;
  context.fillRect(0, 0, width * side, height * side);
  if (side < 6) return;
  context.fillStyle = colours.line;
  for (let x = 1; x < width; x++) context.fillRect(x * side, 0, 1, height * side);
  for (let y = 1; y < height; y++) context.fillRect(0, y * side, width * side, 1);
}
