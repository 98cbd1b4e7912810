"use strict";
// Keys, buttons and choices of the page, and files that are dropped on it.
globalThis.GSVC ??= {};

{
  const $ = (id) => document.getElementById(id);

  function toggleFullScreen() {
    if (document.fullscreenElement) document.exitFullscreen();
    else document.querySelector(".player").requestFullscreen?.();
  }

  const SHOWN = { sigma: "show-sigma", support: "show-support", centres: "show-centres", picture: "show-picture" };

  /** The number of the next I-frame in a direction, or of the last frame there. */
  function keyFrame({ player, frames: framesNow }, step) {
    const frames = framesNow();
    let n = player.number + step;
    while (n > 0 && n < frames.length - 1 && frames[n].type !== "I") n += step;
    return n;
  }

  /** What each key does. */
  const keysOf = (does) => ({
    " ": does.toggle,
    ArrowLeft: ({ shiftKey }) => does.step(shiftKey ? -10 : -1),
    ArrowRight: ({ shiftKey }) => does.step(shiftKey ? 10 : 1),
    Home: () => does.seek(0),
    End: () => does.seek(does.player.count - 1),
    "[": () => does.seek(keyFrame(does, -1)),
    "]": () => does.seek(keyFrame(does, 1)),
    "+": () => does.screen.zoomIn(),
    "=": () => does.screen.zoomIn(),
    "-": () => does.screen.zoomOut(),
    0: () => does.screen.fit(),
    1: () => $("show-sigma").click(),
    2: () => $("show-support").click(),
    3: () => $("show-centres").click(),
    4: () => $("show-picture").click(),
    p: () => $("sharp").click(),
    l: () => $("loop").click(),
    c: () => does.showBeside(does.beside.next()),
    s: does.save,
    f: toggleFullScreen,
    Escape: does.letGo,
  });

  function listenToKeys(does) {
    const keys = keysOf(does);
    document.addEventListener("keydown", (event) => {
      const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
      if (!Object.hasOwn(keys, key) || event.ctrlKey || event.metaKey || event.altKey) return;
      if ($("watch").hidden || !does.ready()) return;
      if (event.target.closest("select, input[type=range]")) { // these have keys of their own
        if (event.target.tagName === "SELECT" || key.startsWith("Arrow") || key === "Home" || key === "End") return;
      }
      if (key === " " && event.target.closest("button, summary, label, input:not([type=range])")) return;
      event.preventDefault();
      keys[key](event);
    });
  }

  function showTab(name) {
    for (const tab of ["watch", "check"]) {
      $(tab).hidden = tab !== name;
      $(`tab-${tab}`).setAttribute("aria-selected", tab === name);
      $(`tab-${tab}`).tabIndex = tab === name ? 0 : -1;
    }
  }

  /** Have buttons, choices and keys do what the viewer does. */
  function listen(does) {
    const { player, screen } = does;
    listenToKeys(does);
    $("play").addEventListener("click", does.toggle);
    $("back").addEventListener("click", () => does.step(-1));
    $("forth").addEventListener("click", () => does.step(1));
    $("live").addEventListener("change", () => $("live").checked && player.seek(player.count - 1));
    $("mode").addEventListener("change", () => does.showBeside($("mode").value));
    $("gain").addEventListener("change", () => does.showBeside($("mode").value));
    $("speed").addEventListener("change", () => (player.speed = Number($("speed").value)));
    $("loop").addEventListener("change", () => (player.loop = $("loop").checked));
    $("layer").addEventListener("change", () => does.useLayer(Number($("layer").value)));
    $("in").addEventListener("click", () => screen.zoomIn());
    $("out").addEventListener("click", () => screen.zoomOut());
    $("fit").addEventListener("click", () => screen.fit());
    $("save").addEventListener("click", does.save);
    $("full").addEventListener("click", toggleFullScreen);
    $("example").addEventListener("click", () => does.openExample(GSVC.EXAMPLE));
    $("example-main").addEventListener("click", () => does.openExample(GSVC.EXAMPLE_MAIN));
    $("open").addEventListener("change", () => {
      const [file] = $("open").files;
      if (file) does.openFile(file);
      $("open").value = ""; // so that the same file can be chosen again
    });
    $("renderer").addEventListener("change", () => does.useRenderer($("renderer").value));
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", does.newColors);
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
    const turnTo = (tab) => {
      showTab(tab);
      if (tab !== "watch") player.pause();
    };
    for (const tab of ["watch", "check"]) {
      $(`tab-${tab}`).addEventListener("click", () => turnTo(tab));
      $(`tab-${tab}`).addEventListener("keydown", (event) => {
        if (event.key !== "ArrowLeft" && event.key !== "ArrowRight") return;
        event.stopPropagation();
        const other = tab === "watch" ? "check" : "watch";
        turnTo(other);
        $(`tab-${other}`).focus();
      });
    }
  }

  /** Have files that are dropped be opened, or be judged by, where `check` is shown. */
  function listenToDrops(does, check) {
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
      } else if (file) does.openFile(file);
    });
  }

  GSVC.controls = { listen, listenToDrops, showTab };
}
