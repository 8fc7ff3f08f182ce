const CHOICES = ['grid', 'model', 'prediction', 'noise'];
const percent = (part) => `${Math.round(100 * part)} %`;
const structureOf = (run) => run.names.join(' and ') || 'no structure';

const cards = [];
const chosen = { structure: '', sort: 'fitness', grid: '', model: '', prediction: '', noise: '' };

/* A card for every run; drawn when it scrolls into view. */
function makeCards(bytes) {
  let at = 0;
  const numbers = (Kind, count) => {
    const end = at + count * Kind.BYTES_PER_ELEMENT;
    const part = new Kind(bytes.slice(at, end).buffer);
    at = end;
    return part;
  };
  for (const run of about.runs) {
    const [xs, ys, rest] = [numbers(Uint16Array, run.robots), numbers(Uint16Array, run.robots), numbers(Uint8Array, run.robots)];
    const item = document.createElement('li');
    const link = document.createElement('a');
    link.href = run.page;
    const frame = document.createElement('div');
    frame.className = 'frame';
    const canvas = document.createElement('canvas');
    canvas.setAttribute('aria-hidden', 'true');
    frame.append(canvas);
    const what = document.createElement('div');
    what.className = 'what';
    const how = document.createElement('div');
    how.className = 'how';
    const [name, share] = [document.createElement('span'), document.createElement('span')];
    name.textContent = structureOf(run);
    share.textContent = percent(run.share);
    what.append(name, share);
    const facts = [`fitness ${run.fitness.toFixed(3)}`, run.grid.replace('x', ' × '), `${run.robots} robots`, `model ${run.model}`];
    if (run.prediction !== 'free') facts.push(run.prediction);
    if (run.noise > 0) facts.push(`noise ${run.noise}`);
    facts.push(`seed ${run.seed}`, run.source);
    how.textContent = facts.join(' · ');
    link.append(frame, what, how);
    item.append(link);
    const card = { run, item, link, drawn: false, seen: false };
    card.draw = () => {
      const room = frame.clientWidth;
      const side = fitCanvas(canvas, run.width, run.height, room, room);
      const pen = canvas.getContext('2d');
      pen.fillStyle = colours.cell;
      pen.fillRect(0, 0, canvas.width, canvas.height);
      const robots = Array.from(rest, (bits, robot) => ({ x: xs[robot], y: ys[robot], heading: bits & 3, ink: about.inks[bits >> 2] }));
      drawRobots(pen, robots, run.height, side);
      card.drawn = true;
    };
    item.card = card;
    cards.push(card);
  }
}

const sight = new IntersectionObserver((entries) => {
  for (const { target, isIntersecting } of entries) {
    target.card.seen = isIntersecting;
    if (isIntersecting && !target.card.drawn) target.card.draw();
  }
}, { rootMargin: '300px' });

function drawAgain() {
  for (const card of cards) {
    card.drawn = false;
    if (card.seen) card.draw();
  }
}

const fits = (run, but = '') => CHOICES.every((key) => key === but || !chosen[key] || String(run[key]) === chosen[key])
  && (but === 'structure' || !chosen.structure || run.names.includes(chosen.structure)
    || (chosen.structure === 'no structure' && !run.names.length));

const byText = (a, b) => a.localeCompare(b, 'en', { numeric: true });
const ORDERS = {
  fitness: (a, b) => b.fitness - a.fitness,
  share: (a, b) => b.share - a.share,
  structure: (a, b) => byText(structureOf(a), structureOf(b)) || b.share - a.share,
  grid: (a, b) => byText(a.grid, b.grid) || b.fitness - a.fitness,
  seed: (a, b) => byText(a.seed, b.seed),
};

/* Shows the selected runs, in order. */
function show() {
  const shown = cards.filter(({ run }) => fits(run));
  shown.sort((a, b) => ORDERS[chosen.sort](a.run, b.run) || byText(a.run.page, b.run.page));
  for (const { item } of cards) sight.unobserve(item);
  element('runs').replaceChildren(...shown.map(({ item }) => item));
  for (const { item } of shown) sight.observe(item);
  element('count').textContent = `${shown.length} of ${cards.length} runs`;
  for (const button of element('structures').children) {
    const { structure } = button.dataset;
    const count = cards.filter(({ run }) => fits(run, 'structure')
      && (!structure || run.names.includes(structure) || (structure === 'no structure' && !run.names.length))).length;
    button.setAttribute('aria-pressed', chosen.structure === structure);
    button.querySelector('span').textContent = count;
  }
  for (const key of [...CHOICES, 'sort']) element(key).value = chosen[key];
  const address = new URLSearchParams(Object.entries(chosen).filter(([key, value]) => value && !(key === 'sort' && value === 'fitness')));
  history.replaceState(null, '', '#' + address);
}

function choose(key, value) {
  chosen[key] = value;
  show();
}

function makeChoices() {
  const structures = about.structures.filter((name) => cards.some(({ run }) => run.names.includes(name)));
  if (cards.some(({ run }) => !run.names.length)) structures.push('no structure');
  for (const structure of ['', ...structures]) {
    const button = document.createElement('button');
    button.type = 'button';
    button.dataset.structure = structure;
    button.append(structure || 'all', document.createElement('span'));
    button.addEventListener('click', () => choose('structure', structure));
    element('structures').append(button);
  }
  for (const key of CHOICES) {
    const values = [...new Set(cards.map(({ run }) => String(run[key])))].sort(byText);
    element(key).add(new Option('any', ''));
    for (const value of values) element(key).add(new Option(value.replace(/^(\d+)x(\d+)$/, '$1 × $2'), value));
    element(key).parentElement.hidden = values.length < 2;
  }
  for (const key of [...CHOICES, 'sort']) element(key).addEventListener('change', (event) => choose(key, event.target.value));
  // The choices are stored in the address, so that going back from a replay restores them.
  const given = new URLSearchParams(location.hash.slice(1));
  for (const key of CHOICES) {
    if ([...element(key).options].some(({ value }) => value === given.get(key))) chosen[key] = given.get(key);
  }
  if (structures.includes(given.get('structure'))) chosen.structure = given.get('structure');
  if (given.get('sort') in ORDERS) chosen.sort = given.get('sort');
  return ['', ...structures];
}

function listen(structures) {
  const next = (values, value) => values[(values.indexOf(value) + 1) % values.length];
  document.addEventListener('keydown', (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target.matches('select')) return;
    const actions = {
      s: () => choose('sort', next(Object.keys(ORDERS), chosen.sort)),
      f: () => choose('structure', next(structures, chosen.structure)),
      t: () => element('theme').click(),
    };
    const here = event.target.closest('li');
    if (here) {
      const all = [...element('runs').children];
      const across = all.filter((item) => item.offsetTop === all[0].offsetTop).length;
      const at = all.indexOf(here);
      const to = { ArrowRight: at + 1, ArrowLeft: at - 1, ArrowDown: at + across, ArrowUp: at - across, Home: 0, End: all.length - 1 }[event.key];
      if (to !== undefined) {
        actions[event.key] = () => all[Math.max(0, Math.min(all.length - 1, to))].firstChild.focus();
      }
    }
    const action = actions[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!action) return;
    event.preventDefault();
    action();
  });
  let width = 0;
  new ResizeObserver(() => {
    if (element('runs').clientWidth === width) return;
    width = element('runs').clientWidth;
    drawAgain();
  }).observe(element('runs'));
}

async function open() {
  makeCards(await unpacked(element('data').textContent));
  listen(makeChoices());
  onTheme(element('theme'), drawAgain);
  show();
}

window.gallery = {
  choose,
  state: () => ({ ...chosen, shown: [...element('runs').children].map(({ card }) => card.run), drawn: cards.filter(({ drawn }) => drawn).length }),
  ready: open().catch((error) => {
    element('failure').hidden = false;
    element('failure').textContent = `This page cannot be shown: ${error.message}.`;
    element('main').hidden = true;
    throw error;
  }),
};
