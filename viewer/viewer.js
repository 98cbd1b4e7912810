"use strict";
// The page: opens streams, and lets player, screen, timeline and panels know of each other.
globalThis.GSVC ??= {};

{
  const { number, faultInWords, levelInWords, quality, element, tell } = GSVC.words;
  const { ofFile, ofText, ofBytes, named, viewed } = GSVC.inputs;
  const $ = (id) => document.getElementById(id);
  const state = { file: null, opening: null, shown: 0, waiting: null }; // shown: where the frame on the screen stands
  const notices = { file: [], source: [], saving: [], drawing: [] }; // lines above the picture
  const BEST = 3; // the highest layer that a stream can have
  const MOST_LEVEL = 3; // a stream of a higher one is decoded only when somebody asks for it
  const drawn = []; // when the last pictures were drawn

  // ---- frames

  const player = new GSVC.Player(showFrame, () => {
    $("play").textContent = player.playing ? "Pause" : "Play";
    drawn.length = 0;
  });
  const timeline = new GSVC.Timeline([$("chart"), $("psnr")], $("seek"), (n) => seek(n), (n) => {
    const psnr = state.file.comparison?.psnr[n];
    return typeof psnr === "number" ? `, ${GSVC.panels.decibels(psnr)}` : "";
  });
  const curve = new GSVC.Curve($("psnr"), (n) => timeline.place(n));
  const screen = new GSVC.Screen($("screen"), $("marks"), {
    drawn: pictureDrawn,
    point: (place) => look.at(place),
    pick: (place) => player.late || look.follow(place),
    view: () => {
      $("zoom").textContent = `${number(100 * screen.view.scale)} %`;
      beside.moved();
    },
    fault: (error) => {
      player.pause();
      drawingFailed(error);
    },
  });

  const look = new GSVC.Look(screen, () => state.shown);
  const beside = new GSVC.Beside($("screen"), (canvas) => screen.place(canvas), sourceFailed);

  /** Show a frame, at once or as soon as those that it needs are decoded; of several that are asked for the last one. */
  function showFrame(n) {
    clearTimeout(state.waiting);
    const steps = state.file.stream.frame.steps(n);
    const settle = () => {
      if (player.late) $("busy").hidden = true;
      player.late = false;
    };
    const goOn = () => {
      const begun = performance.now();
      for (;;) {
        let step;
        try {
          step = steps.next();
        } catch (error) {  // no memory is left, say
          settle();
          player.pause();
          throw error;
        }
        if (step.done) {
          settle();
          put(n, step.value);
          return;
        }
        if (performance.now() - begun > GSVC.LONGEST_STEP) break;
      }
      player.late = true;
      $("busy").hidden = false;
      $("busy").textContent = `Decoding frame ${number(state.file.stream.frames[n].number)}`;
      state.waiting = setTimeout(goOn);
    };
    goOn();
  }

  function put(n, decoded) {
    const { stream, times, comparison } = state.file;
    const frame = stream.frames[n];
    const time = times?.[n] ?? frame.number / player.rate;
    state.shown = n;
    screen.setFrame(decoded);
    beside.frame(n);
    timeline.show(n);
    $("place").textContent = `${GSVC.panels.numbered(frame.number, stream.frames)}, ${frame.type}`;
    tell($("frame"), GSVC.panels.frameFacts(n, stream.frames, time, comparison?.psnr[n]));
    GSVC.panels.showParts($("parts"), $("parts-legend"), frame);
    if (comparison) curve.show(comparison.psnr, stream.frames, n);
    look.again();
  }

  /** Go to a frame, as somebody asked for: a live stream is not followed any more. */
  function seek(n) {
    $("live").checked = false;
    player.seek(n);
  }

  function step(frames) {
    $("live").checked = false;
    player.step(frames);
  }

  function toggle() {
    $("live").checked = false;
    player.toggle();
  }

  function pictureDrawn() {
    const now = performance.now();
    drawn.push(now);
    while (now - drawn[0] > 1000) drawn.shift();
    const { width, height } = screen.picture;
    const speed = (1000 * (drawn.length - 1)) / (now - drawn[0]);
    tell($("drawing"), [
      ["device", screen.renderer.description],
      ["canvas", `${width} × ${height}`],
      ["speed", player.playing && drawn.length > 1 ? `${number(speed, 1)} pictures a second` : "–"],
    ]);
  }

  // ---- files

  /** Have lines about something stand above the picture; none: take them away. What stands there is not said again. */
  function notice(about, lines) {
    if (String(lines) === String(notices[about])) return;
    notices[about] = lines;
    const all = Object.values(notices).flat();
    $("notice").hidden = all.length === 0;
    $("notice").replaceChildren(...all.map((line) => element("p", {}, line)));
  }

  /**
   * Open an input, up to a layer, unless another one is to be opened meanwhile. Without a layer it is the best one of a
   * level that is decoded without a question, if there is one.
   */
  async function open(input, asked = null) {
    const layer = asked ?? BEST;
    state.opening?.abort();
    const { signal } = (state.opening = new AbortController());
    const { name, live = false } = input;
    const progress = (part) => {
      $("busy").hidden = false;
      $("busy").textContent = `Reading ${name}: ${number(100 * part)} %`;
    };
    GSVC.controls.showTab("watch");
    $("ask").hidden = true;
    $("busy").hidden = !live;
    $("busy").textContent = `Waiting for the first frame of ${name}`;
    $("status").textContent = `Reading ${name}.`;
    const reading = new GSVC.StreamReading({ quality: layer, salvage: true });
    try {
      for await (const piece of input.pieces(signal)) {
        signal.throwIfAborted();
        reading.append(piece);
        if (reading.start() && !input.isAllowed && levelOf(reading.header, layer) > MOST_LEVEL) {
          const lower = reading.header.points.findLastIndex(({ level }) => level <= MOST_LEVEL);
          if (asked === null && lower >= 0) return open(input, lower);
          ask(input, layer, levelOf(reading.header, layer));
          return;
        }
        if (!live) continue;
        await GSVC.readInSteps(reading, () => {}, signal);
        grown(input, reading);
      }
      signal.throwIfAborted();
      reading.append(new Uint8Array(0), true);
      await GSVC.readInSteps(reading, live ? () => {} : progress, signal);
      if (live && state.file?.reading === reading) ended();
      else show(input, reading, layer);
    } catch (error) {
      if (signal.aborted) return; // the next one says what it does
      const broken = state.file?.reading === reading;
      notice("file", broken ? [`${name} broke off: ${error.message}`, "Load the page again to follow what comes."]
        : [`${name} could not be opened: ${error.message}`, ...stillShown()]);
      $("status").textContent = "";
      if (broken) $("live-label").hidden = true;
    }
    $("busy").hidden = true;
  }

  /** The level of a stream up to a layer. */
  const levelOf = ({ level, points }, layer) => points[Math.min(layer, points.length - 1)]?.level ?? level;

  /** Say why a stream is not decoded by itself; a button opens it anew, and decodes it. */
  function ask(input, layer, level) {
    const lines = [...levelInWords(input.name, level, MOST_LEVEL), ...stillShown()];
    $("why").replaceChildren(...lines.map((line) => element("p", {}, line)));
    $("decode").onclick = () => open({ ...input, isAllowed: true }, layer);
    $("ask").hidden = false;
    $("busy").hidden = true;
    $("status").textContent = ""; // the question is an alert
  }

  const stillShown = () => (state.file ? [`${state.file.input.name} is still shown.`] : []);

  /** Show a stream, and play it to those who do not mind motion. */
  function show(input, reading, layer) {
    const { header, frames } = reading;
    tellFaults(input, reading);
    notice("saving", []);
    if (frames.length === 0) return;
    state.file?.comparison?.end();
    const stream = { frames, frame: reading.seeker() };
    const times = input.live ? null : GSVC.timesOf(reading);
    state.file = { input, reading, stream, times, comparison: null };
    look.begin(stream);
    document.title = `${input.name} – GSVC viewer`;
    compare();
    tellFile();
    offerLayers(header.layer_count ?? 1, layer);
    $("live-label").hidden = !input.live || reading.done;
    $("live").checked = input.live === true;
    enableMoves();
    timeline.setFrames(frames, reading.missingAtEnd);
    screen.setVideo(header.width, header.height, header.bit_depth);
    player.load(frames.length, header.frame_rate_numerator / header.frame_rate_denominator, state.file.times);
    if (!input.live && !matchMedia("(prefers-reduced-motion: reduce)").matches) player.play();
  }

  /** What is wrong with a stream, once all of it was read. */
  function tellFaults({ name }, reading) {
    const { frames, faults: [fault], size } = reading;
    const rest = frames.length === 0 ? stillShown() : [];
    notice("file", fault ? [name, ...faultInWords(fault, size, reading), ...rest] : []);
    $("status").textContent = fault ? `${name} is damaged.` : `${name}: ${frames.length} frames.`;
  }

  function tellFile() {
    const { input: { name, source }, reading: { header, frames, faults: [fault], size }, times, comparison } = state.file;
    const psnr = comparison?.psnr;
    tell($("file"), GSVC.panels.fileFacts({ name, size, header, frames, times, fault, source: comparison && source, psnr }));
  }

  function enableMoves() {
    for (const id of ["back", "play", "forth"]) $(id).disabled = state.file.stream.frames.length < 2;
  }

  // ---- a stream that grows

  /** A live stream has come further: its newest frame is shown to who follows it. */
  function grown(input, reading) {
    const { frames } = reading;
    if (frames.length === 0) return;
    $("busy").hidden = true;
    if (state.file?.reading !== reading) show(input, reading, reading.quality);
    else if (reading.faultCount > 0) tellFaults(input, reading);
    $("layers").hidden = true; // until all is there
    player.extend(frames.length);
    timeline.setFrames(frames, 0, player.number);
    tellFile();
    enableMoves();
    if ($("live").checked) {
      player.pause();
      player.seek(frames.length - 1);
    } else showFrame(player.number);
    measure();
  }

  /** A live stream has ended. */
  function ended() {
    const { input, reading } = state.file;
    grown(input, reading);
    $("live-label").hidden = true;
    $("live").checked = false;
    tellFaults(input, reading);
    timeline.setFrames(reading.frames, reading.missingAtEnd, player.number);
    offerLayers(reading.header.layer_count ?? 1, reading.quality);
    state.file.input = ofBytes(input, reading.bytes);
    state.file.times = player.times = GSVC.timesOf(reading);
    tellFile();
  }

  // ---- the source

  /** Compare the stream with its source from now on, if it has one. */
  function compare() {
    const { input: { source, folder }, reading } = state.file;
    const misfit = source && GSVC.Comparison.misfit(source, reading.header);
    notice("source", misfit ? [misfit] : []);
    if (source && !misfit) {
      const stream = { frames: reading.frames, frame: reading.seeker() };
      state.file.comparison = new GSVC.Comparison(source, folder, stream, $("renderer").value);
    }
    $("beside").hidden = $("psnr").hidden = !state.file.comparison;
    beside.use(state.file.comparison);
    $("mode").value = beside.mode;
    measure();
  }

  /** Measure the frames that were not measured yet. */
  function measure() {
    const { comparison, stream } = state.file;
    comparison?.measureAll((n) => {
      if (n === player.number) showFrame(n);
      else curve.show(comparison.psnr, stream.frames, player.number);
      if (n % 10 === 0 || n === stream.frames.length - 1) tellFile();
    }, sourceFailed);
  }

  function sourceFailed(error) {
    notice("source", [`The source is not shown: ${error.message}`]);
  }

  function showBeside(mode) {
    if (!state.file?.comparison) return;
    $("mode").value = mode;
    $("gain-label").hidden = mode !== "difference";
    beside.show(mode, Number($("gain").value));
  }

  // ---- layers

  /** The choice of how many layers are shown above the base. */
  function offerLayers(count, layer) {
    $("layers").hidden = count === 1;
    $("layer").replaceChildren(...Array.from({ length: count }, (_, n) => element("option", { value: n }, quality(n))));
    $("layer").value = Math.min(layer, count - 1);
  }

  /** Show the stream up to a layer: the same frame, and playing if it was played. */
  async function useLayer(layer) {
    const { input, reading: { bytes } } = state.file;
    const { number: at, playing } = player;
    const { mode } = beside;
    await open(ofBytes(input, bytes), layer);
    if (state.file.reading.bytes.buffer !== bytes.buffer) return; // another one was opened meanwhile
    player.seek(at);
    showBeside(mode);
    if (playing) player.play();
    else player.pause();
  }

  /** Save the frame that is shown as a PNG file, with the samples of deterministic decoding: the same on every machine. */
  async function save() {
    if (!screen.frame) return;
    const { width, height, bitDepth } = screen.video;
    const { number: at } = state.file.stream.frames[state.shown];
    const { parameters } = screen.frame;
    const name = `${state.file.input.name.replace(/\.gsvc$/, "")}_${String(at).padStart(6, "0")}.png`;
    let file;
    try {
      const sum = await GSVC.inSteps(GSVC.renderingSteps(parameters, width, height), (part) => {
        $("status").textContent = `${name}: ${number(100 * part)} %`;
      });
      file = await GSVC.png(GSVC.toFrameDeterministic(sum, bitDepth), width, height, bitDepth);
    } catch (error) { // not enough memory for a very large frame
      notice("saving", [`${name} could not be made: ${error.message}`]);
      return;
    }
    notice("saving", []);
    const link = element("a", { href: URL.createObjectURL(file), download: name });
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
    $("status").textContent = `${name} is saved.`;
  }

  // ---- the renderer

  function drawingFailed(error) {
    notice("drawing", [`Drawing failed: ${error.message}`, "Another renderer can be chosen below “Drawn by”."]);
  }

  async function useRenderer(kind) {
    try {
      await screen.useRenderer(kind);
      notice("drawing", []);
      drawn.length = 0;
    } catch (error) {
      drawingFailed(error);
      if (screen.renderer) $("renderer").value = screen.renderer.kind; // it goes on
    }
  }

  async function openViewed(path) {
    try {
      await open(await viewed(path));
    } catch (error) {
      notice("file", [`gsvc view does not answer: ${error.message}`, "It ends with Ctrl-C; start it again."]);
    }
  }

  async function start() {
    const does = {
      player, screen, beside, seek, step, toggle, save, showBeside, useLayer, useRenderer,
      ready: () => state.file !== null,
      frames: () => state.file.stream.frames,
      letGo: () => look.letGo(),
      openFile: (file) => open(ofFile(file)),
      openExample: (example) => open(ofText(example)),
      newColors: () => {
        timeline.show(player.number);
        curve.draw();
        screen.changed();
      },
    };
    GSVC.controls.listen(does);
    const asked = new URLSearchParams(location.search);
    const withVectors = location.protocol.startsWith("http") && !asked.has("view");
    GSVC.controls.listenToDrops(does, new GSVC.CheckTab($("check"), () => $("renderer").value, withVectors));
    if (["webgpu", "webgl2"].includes(asked.get("renderer"))) $("renderer").value = asked.get("renderer");
    const ready = useRenderer($("renderer").value); // a driver may take a while: meanwhile the file is read
    await (asked.has("view") ? openViewed(asked.get("view"))
      : open(asked.has("file") ? named(asked.get("file")) : ofText(GSVC.EXAMPLE)));
    await ready;
  }

  start();
}
