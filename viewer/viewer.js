"use strict";
// The page: opens files, and lets player, screen, timeline and panels know of each other.
globalThis.GSVC ??= {};

{
  const { number, faultInWords, element, tell } = GSVC.words;
  const $ = (id) => document.getElementById(id);
  const POINT = "Point at the picture to see which splat is there; click to follow it.";
  const FOLLOWED = "Followed from frame to frame; click it again to let it go.";
  const state = { file: null, opening: null, track: null, point: null };
  const notices = { file: [], saving: [], drawing: [] }; // lines above the picture
  const BEST = 3; // the highest layer that a stream can have
  const drawn = []; // when the last pictures were drawn

  // ---- frames

  const player = new GSVC.Player(showFrame, () => {
    $("play").textContent = player.playing ? "Pause" : "Play";
    drawn.length = 0;
  });
  const timeline = new GSVC.Timeline($("chart"), $("seek"), (n) => player.seek(n));
  const screen = new GSVC.Screen($("screen"), $("marks"), {
    drawn: pictureDrawn,
    point: (place) => {
      state.point = place;
      lookAgain();
    },
    pick: follow,
    view: () => {
      $("zoom").textContent = `${number(100 * screen.view.scale)} %`;
    },
    fault: (error) => {
      player.pause();
      drawingFailed(error);
    },
  });

  function showFrame(n) {
    const { stream } = state.file;
    screen.setFrame(stream.frame(n));
    timeline.show(n);
    $("place").textContent = `${GSVC.panels.numbered(n, stream.frames)}, ${stream.frames[n].type}`;
    tell($("frame"), GSVC.panels.frameFacts(stream.frames[n], stream.frames, player.rate));
    GSVC.panels.showParts($("parts"), $("parts-legend"), stream.frames[n]);
    lookAgain();
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

  // ---- splats

  /** Tell about the splat that is followed, or else of the one under the pointer. */
  function lookAgain() {
    if (!screen.frame) return;
    const { parameters, origins } = screen.frame;
    const { point, track } = state;
    const found = point && GSVC.splats.lookAt(parameters, point.x, point.y);
    const index = track ? track.indexIn(player.number) : found ? found.index : -1;
    screen.followed = { index: track ? index ?? -1 : -1, points: track ? track.points() : [] };
    screen.pointed = found ? found.index : -1;
    screen.marksChanged();
    tip(found, point);
    const facts = index !== null && index >= 0 ? GSVC.panels.splatFacts(parameters, index, origins[index] < 0) : [];
    if (index === null) facts.push(["splat", "followed; too many frames away"]);
    else if (track && index < 0) facts.push(["splat", "followed; not in this frame"]);
    if (found && !track) facts.push(...GSVC.panels.placeFacts(found, point));
    const hint = element("p", { class: "hint" }, track ? FOLLOWED : POINT);
    const list = element("dl", { class: "facts" });
    tell(list, facts);
    $("splat").replaceChildren(...(facts.length ? [list, hint] : [hint]));
  }

  function tip(found, point) {
    $("tip").hidden = !found || found.index < 0;
    if ($("tip").hidden) return;
    $("tip").textContent = `splat ${found.index} · ${found.covering} here`;
    const [x, y] = point.onPage;
    const room = $("screen").clientWidth - $("tip").offsetWidth - 4;
    $("tip").style.transform = `translate(${Math.max(Math.min(x + 14, room), 4)}px, ${y + 18}px)`;
  }

  function follow(place) {
    if (!screen.frame) return;
    const { index } = GSVC.splats.lookAt(screen.frame.parameters, place.x, place.y);
    const same = state.track && index === state.track.indexIn(player.number);
    state.track = index < 0 || same ? null : new GSVC.splats.Track(state.file.stream, player.number, index);
    state.point = place;
    lookAgain();
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

  /** Open a stream whose bytes `read` gives a promise of, up to a layer, unless another one is to be opened meanwhile. */
  async function open(name, read, layer = BEST) {
    state.opening?.abort();
    const { signal } = (state.opening = new AbortController());
    const progress = (part) => {
      $("busy").hidden = false;
      $("busy").textContent = `Reading ${name}: ${number(100 * part)} %`;
    };
    showTab("watch");
    $("busy").hidden = true;
    $("status").textContent = `Reading ${name}.`;
    try {
      const data = await read();
      signal.throwIfAborted();
      show(name, data, await GSVC.openStreamInSteps(data, progress, signal, layer), layer);
    } catch (error) {
      if (signal.aborted) return; // the next one says what it does
      notice("file", [`${name} could not be opened: ${error.message}`, ...stillShown()]);
      $("status").textContent = "";
    }
    $("busy").hidden = true;
  }

  const stillShown = () => (state.file ? [`${state.file.name} is still shown.`] : []);

  /** Show a stream, and play it to those who do not mind motion. */
  function show(name, data, stream, layer) {
    const { header, frames, fault } = stream;
    const size = data.length;
    const rest = frames.length === 0 ? stillShown() : [];
    notice("file", fault ? [name, ...faultInWords(fault, size, frames.length), ...rest] : []);
    notice("saving", []);
    $("status").textContent = fault ? `${name} is damaged.` : `${name}: ${frames.length} frames.`;
    if (frames.length === 0) return;
    state.file = { name, data, stream };
    state.track = state.point = null;
    document.title = `${name} – GSVC viewer`;
    tell($("file"), GSVC.panels.fileFacts({ name, size, header, frames, fault }));
    offerLayers(header.layer_count ?? 1, layer);
    for (const id of ["back", "play", "forth"]) $(id).disabled = frames.length < 2;
    timeline.setFrames(frames);
    screen.setVideo(header.width, header.height, header.bit_depth);
    player.load(frames.length, header.frame_rate_numerator / header.frame_rate_denominator);
    if (!matchMedia("(prefers-reduced-motion: reduce)").matches) player.play();
  }

  /** The choice of how many layers are shown above the base. */
  function offerLayers(count, layer) {
    $("layers").hidden = count === 1;
    const words = (n) => (n === 0 ? "base" : `base + ${n}`);
    $("layer").replaceChildren(...Array.from({ length: count }, (_, n) => element("option", { value: n }, words(n))));
    $("layer").value = Math.min(layer, count - 1);
  }

  /** Show the stream up to a layer: the same frame, and playing if it was played. */
  async function useLayer(layer) {
    const { name, data } = state.file;
    const { number: at, playing } = player;
    await open(name, async () => data, layer);
    if (state.file.data !== data) return; // another one was opened meanwhile
    player.seek(at);
    if (playing) player.play();
    else player.pause();
  }

  const openFile = (file) => open(file.name, async () => new Uint8Array(await file.arrayBuffer()));

  const openExample = ({ name, base64 }) => open(name,
    async () => Uint8Array.from(atob(base64), (character) => character.charCodeAt(0)));

  /** A file that the page's address names, `index.html?file=clip.gsvc`, on the server that the page came from. */
  const openNamed = (path) => open(path.split("/").pop(), async () => {
    if (location.protocol === "file:") throw new Error("a page opened from a disk may not look for files. Drop it here.");
    const response = await fetch(path, { mode: "same-origin" });
    if (!response.ok) throw new Error(`${response.status} ${response.statusText}`);
    return new Uint8Array(await response.arrayBuffer());
  });

  /** Save the frame that is shown as a PNG file, with the samples of deterministic decoding: the same on every machine. */
  async function save() {
    if (!screen.frame) return;
    const { width, height, bitDepth } = screen.video;
    const name = `${state.file.name.replace(/\.gsvc$/, "")}_${String(player.number).padStart(6, "0")}.png`;
    let file;
    try {
      const sum = GSVC.renderSumDeterministic(screen.frame.parameters, width, height);
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

  // ---- controls

  function toggleFullScreen() {
    if (document.fullscreenElement) document.exitFullscreen();
    else document.querySelector(".player").requestFullscreen?.();
  }

  const SHOWN = { sigma: "show-sigma", support: "show-support", centres: "show-centres", picture: "show-picture" };

  /** The number of the next I-frame in a direction, or of the last frame there. */
  function keyFrame(step) {
    const { frames } = state.file.stream;
    let n = player.number + step;
    while (n > 0 && n < frames.length - 1 && frames[n].type !== "I") n += step;
    return n;
  }

  const KEYS = {
    " ": () => player.toggle(),
    ArrowLeft: ({ shiftKey }) => player.step(shiftKey ? -10 : -1),
    ArrowRight: ({ shiftKey }) => player.step(shiftKey ? 10 : 1),
    Home: () => player.seek(0),
    End: () => player.seek(player.count - 1),
    "[": () => player.seek(keyFrame(-1)),
    "]": () => player.seek(keyFrame(1)),
    "+": () => screen.zoomIn(),
    "=": () => screen.zoomIn(),
    "-": () => screen.zoomOut(),
    0: () => screen.fit(),
    1: () => $("show-sigma").click(),
    2: () => $("show-support").click(),
    3: () => $("show-centres").click(),
    4: () => $("show-picture").click(),
    p: () => $("sharp").click(),
    l: () => $("loop").click(),
    s: save,
    f: toggleFullScreen,
    Escape: () => {
      state.track = null;
      lookAgain();
    },
  };

  document.addEventListener("keydown", (event) => {
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    if (!Object.hasOwn(KEYS, key) || event.ctrlKey || event.metaKey || event.altKey) return;
    if ($("watch").hidden || !state.file) return;
    if (event.target.closest("select, input[type=range]")) { // these have keys of their own
      if (event.target.tagName === "SELECT" || key.startsWith("Arrow") || key === "Home" || key === "End") return;
    }
    if (key === " " && event.target.closest("button, summary, label, input:not([type=range])")) return;
    event.preventDefault();
    KEYS[key](event);
  });

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

  function showTab(name) {
    for (const tab of ["watch", "check"]) {
      $(tab).hidden = tab !== name;
      $(`tab-${tab}`).setAttribute("aria-selected", tab === name);
      $(`tab-${tab}`).tabIndex = tab === name ? 0 : -1;
    }
    if (name !== "watch") player.pause();
  }

  function listen() {
    $("play").addEventListener("click", () => player.toggle());
    $("back").addEventListener("click", () => player.step(-1));
    $("forth").addEventListener("click", () => player.step(1));
    $("speed").addEventListener("change", () => (player.speed = Number($("speed").value)));
    $("loop").addEventListener("change", () => (player.loop = $("loop").checked));
    $("layer").addEventListener("change", () => useLayer(Number($("layer").value)));
    $("in").addEventListener("click", () => screen.zoomIn());
    $("out").addEventListener("click", () => screen.zoomOut());
    $("fit").addEventListener("click", () => screen.fit());
    $("save").addEventListener("click", save);
    $("full").addEventListener("click", toggleFullScreen);
    $("example").addEventListener("click", () => openExample(GSVC.EXAMPLE));
    $("example-main").addEventListener("click", () => openExample(GSVC.EXAMPLE_MAIN));
    $("open").addEventListener("change", () => {
      const [file] = $("open").files;
      if (file) openFile(file);
      $("open").value = ""; // so that the same file can be chosen again
    });
    $("renderer").addEventListener("change", () => useRenderer($("renderer").value));
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
      timeline.show(player.number); // both draw in the colours of the page
      screen.changed();
    });
    $("sharp").addEventListener("change", () => {
      screen.sharp = $("sharp").checked;
      screen.changed();
    });
    for (const [what, id] of Object.entries(SHOWN)) {
      $(id).addEventListener("change", () => {
        screen.shown[what] = $(id).checked;
        screen.changed();
      });
    }
    for (const tab of ["watch", "check"]) {
      $(`tab-${tab}`).addEventListener("click", () => showTab(tab));
      $(`tab-${tab}`).addEventListener("keydown", (event) => {
        if (event.key !== "ArrowLeft" && event.key !== "ArrowRight") return;
        event.stopPropagation();
        const other = tab === "watch" ? "check" : "watch";
        showTab(other);
        $(`tab-${other}`).focus();
      });
    }
  }

  function listenToDrops(check) {
    let inside = 0; // elements that a drag has entered and not left
    const mark = (change) => {
      inside += change;
      $("drop").hidden = inside <= 0;
    };
    addEventListener("dragenter", () => mark(1));
    addEventListener("dragleave", () => mark(-1));
    addEventListener("dragover", (event) => event.preventDefault());
    addEventListener("drop", (event) => {
      event.preventDefault();
      mark(-inside);
      const [file] = event.dataTransfer.files;
      if (!$("check").hidden && !file?.name.endsWith(".gsvc")) {
        const files = GSVC.droppedFiles(event.dataTransfer); // at once: the event has them no longer than itself
        check.run(async () => GSVC.vectorsAmong(await files));
      } else if (file) openFile(file);
    });
  }

  async function start() {
    listen();
    listenToDrops(new GSVC.CheckTab($("check"), () => $("renderer").value));
    const asked = new URLSearchParams(location.search);
    if (["webgpu", "webgl2"].includes(asked.get("renderer"))) $("renderer").value = asked.get("renderer");
    const ready = useRenderer($("renderer").value); // a driver may take a while: meanwhile the file is read
    await (asked.has("file") ? openNamed(asked.get("file")) : openExample(GSVC.EXAMPLE));
    await ready;
  }

  start();
}
