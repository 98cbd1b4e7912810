"use strict";
// The picture: where it lies on the page, how it is zoomed and moved, and what is drawn over it.
globalThis.GSVC ??= {};

{
  const MAX_PIXELS = 2 ** 23; // pixels of a canvas
  const LONGEST_SIDE = 8192;
  const LARGEST_SCALE = 512;
  const STEP = 1.25; // factor of the zoom for a key or a notch of the wheel
  const CLICK = 4; // pixels that a pointer may move in a click

  const clamp = (value, low, high) => Math.min(Math.max(value, low), high);

  GSVC.Screen = class {
    /**
     * @param {HTMLElement} element
     * @param {HTMLCanvasElement} marks what lies over the picture
     * @param {Object} on drawn(): the picture was drawn; point(place | null), pick(place): x and y in the frame;
     *   view(): zoom or place have changed; fault(error)
     */
    constructor(element, marks, on) {
      Object.assign(this, { element, marks, on });
      this.shown = { sigma: false, support: false, centres: false, picture: true };
      this.sharp = true;
      this.fitted = true;
      this.video = null; // width, height, bitDepth
      this.frame = null; // parameters, and origins: of each splat its index in the frame before, or -1
      this.followed = { index: -1, points: [] };
      this.pointed = -1;
      this.view = { scale: 1, left: 0, top: 0 }; // in pixels of the page
      this.pointers = new Map();
      new ResizeObserver(() => this.#resized()).observe(element);
      this.#listen();
    }

    /**
     * A renderer that draws from now on, if no other one is asked for meanwhile.
     *
     * It has a canvas of its own, since a canvas cannot change its kind.
     */
    async useRenderer(kind) {
      const canvas = document.createElement("canvas");
      canvas.className = "picture";
      canvas.setAttribute("aria-hidden", "true");
      const asked = (this.asked = {});
      const renderer = await GSVC.createRenderer(kind, canvas).catch((error) => {
        if (asked === this.asked) throw error;
      });
      if (asked !== this.asked) {
        renderer?.destroy();
        return;
      }
      this.renderer?.destroy();
      this.picture?.remove();
      this.renderer = renderer;
      this.picture = canvas;
      this.element.prepend(canvas);
      this.changed();
    }

    setVideo(width, height, bitDepth) {
      this.video = { width, height, bitDepth };
      this.element.style.setProperty("--aspect", `${width} / ${height}`);
      this.fit();
    }

    setFrame(frame) {
      this.frame = frame;
      this.changed();
    }

    /** Have the picture drawn again, before the next one is shown. */
    changed() {
      this.pictureIsOld = true;
      this.marksChanged();
    }

    marksChanged() {
      this.waiting ??= requestAnimationFrame(() => {
        this.waiting = null;
        this.#draw();
      });
    }

    // ---- zoom

    fit() {
      if (!this.video) return;
      const { clientWidth, clientHeight } = this.element;
      const { width, height } = this.video;
      const scale = Math.min(clientWidth / width, clientHeight / height, LARGEST_SCALE);
      this.#see(scale, (width - clientWidth / scale) / 2, (height - clientHeight / scale) / 2);
      this.fitted = true;
    }

    /** Zoom so that what is at a place of the element (or in its middle) stays there. */
    zoomBy(factor, x = this.element.clientWidth / 2, y = this.element.clientHeight / 2) {
      if (!this.video) return;
      const { left, top, scale } = this.view;
      const { clientWidth, clientHeight } = this.element;
      const smallest = Math.min(1, clientWidth / this.video.width, clientHeight / this.video.height) / 4;
      const wanted = clamp(scale * factor, smallest, LARGEST_SCALE);
      this.#see(wanted, left + x / scale - x / wanted, top + y / scale - y / wanted);
    }

    zoomIn() {
      this.zoomBy(STEP);
    }

    zoomOut() {
      this.zoomBy(1 / STEP);
    }

    moveBy(x, y) {
      const { left, top, scale } = this.view;
      this.#see(scale, left - x / scale, top - y / scale);
    }

    /** Show the frame so; some of it stays in sight. */
    #see(scale, left, top) {
      const { width, height } = this.video;
      const across = this.element.clientWidth / scale;
      const down = this.element.clientHeight / scale;
      this.fitted = false;
      this.view = {
        scale,
        left: clamp(left, Math.min(width, across) / 4 - across, width - Math.min(width, across) / 4),
        top: clamp(top, Math.min(height, down) / 4 - down, height - Math.min(height, down) / 4),
      };
      this.changed();
      this.on.view();
    }

    #resized() {
      if (this.fitted) this.fit();
      else this.changed();
    }

    // ---- drawing

    #draw() {
      if (!this.video || !this.frame) return;
      if (this.renderer && this.pictureIsOld && !this.drawing) this.#drawPicture();
      this.#drawMarks();
    }

    /** Draw; what changes meanwhile is drawn afterwards. */
    async #drawPicture() {
      this.drawing = true;
      this.pictureIsOld = false;
      const { renderer } = this;
      try {
        await renderer.draw(this.frame.parameters, this.#layOut());
        if (renderer === this.renderer) this.on.drawn();
      } catch (error) {
        if (renderer === this.renderer) this.on.fault(error); // else it was ended in the midst of it
      }
      this.drawing = false;
      if (this.pictureIsOld) this.marksChanged();
    }

    /** Pixels of the canvas for one of the page: fewer where there would be too many. */
    #density() {
      const { clientWidth, clientHeight } = this.element;
      return Math.min(devicePixelRatio, Math.sqrt(MAX_PIXELS / Math.max(clientWidth * clientHeight, 1)));
    }

    /** Columns and rows of a canvas that covers the element. */
    #pixels(density) {
      const { clientWidth, clientHeight } = this.element;
      return [clientWidth, clientHeight].map((side) => Math.max(1, Math.round(side * density)));
    }

    /** Give the canvas its size and place; the view of the frame that it shows. */
    #layOut() {
      const { width, height } = this.video;
      const { scale, left, top } = this.view;
      const density = this.#density();
      const { style } = this.picture;
      style.visibility = this.shown.picture ? "" : "hidden";
      this.element.classList.toggle("bare", !this.shown.picture);
      const large = width * height > MAX_PIXELS || Math.max(width, height) > LONGEST_SIDE;
      if (large || (this.sharp && scale * density !== 1)) { // the splats, drawn at the page's resolution
        this.#sizePicture(...this.#pixels(density));
        Object.assign(style, { width: "100%", height: "100%", transform: "", imageRendering: "" });
        return { ...this.video, scale: scale * density, left, top };
      }
      this.#sizePicture(width, height);
      this.place(this.picture);
      return { ...this.video, scale: 1, left: 0, top: 0 };
    }

    /** Have a canvas with the frame's own pixels lie where the frame is seen, enlarged or made smaller by the browser. */
    place({ style }) {
      const { width, height } = this.video;
      const { scale, left, top } = this.view;
      Object.assign(style, {
        width: `${width * scale}px`, height: `${height * scale}px`,
        transform: `translate(${-left * scale}px, ${-top * scale}px)`,
        imageRendering: scale * devicePixelRatio >= 1 ? "pixelated" : "auto",
      });
    }

    #sizePicture(width, height) {
      if (this.picture.width !== width) this.picture.width = width;
      if (this.picture.height !== height) this.picture.height = height;
    }

    #drawMarks() {
      const density = this.#density();
      const { marks, view, frame, video, shown } = this;
      const [width, height] = this.#pixels(density);
      if (marks.width !== width) marks.width = width;
      if (marks.height !== height) marks.height = height;
      const context = marks.getContext("2d");
      context.clearRect(0, 0, width, height);
      const scale = view.scale * density;
      const to = { scale, left: -view.left * scale, top: -view.top * scale };
      const colors = getComputedStyle(this.element);
      context.strokeStyle = colors.getPropertyValue("--edge");
      context.lineWidth = density;
      const edge = density / 2; // half of the line, which lies around the frame
      context.strokeRect(to.left - edge, to.top - edge, video.width * scale + density, video.height * scale + density);
      const outlines = new GSVC.splats.Outlines(context, frame.parameters, to);
      const { origins } = frame;
      outlines.draw((n) => origins[n] >= 0, colors.getPropertyValue("--kept-mark"), shown, density);
      outlines.draw((n) => origins[n] < 0, colors.getPropertyValue("--new-mark"), shown, density);
      if (this.followed.points.length > 1) outlines.trail(this.followed.points, density);
      const standsOut = this.followed.index >= 0 ? this.followed.index : this.pointed;
      if (standsOut >= 0 && standsOut < frame.parameters.length / 8) outlines.highlight(standsOut, density);
    }

    // ---- pointers

    /** The place of the frame under a pointer. */
    #place(event) {
      const { left, top } = this.element.getBoundingClientRect();
      const { view } = this;
      const x = event.clientX - left - this.element.clientLeft;
      const y = event.clientY - top - this.element.clientTop;
      return { x: view.left + x / view.scale, y: view.top + y / view.scale, onPage: [x, y] };
    }

    #listen() {
      const { element } = this;
      element.addEventListener("wheel", (event) => {
        event.preventDefault();
        const notches = event.deltaY / (event.deltaMode === 0 ? 100 : 3);
        this.zoomBy(STEP ** -clamp(notches, -4, 4), ...this.#place(event).onPage);
      }, { passive: false });
      element.addEventListener("pointerdown", (event) => {
        if (event.button !== 0) return;
        element.setPointerCapture(event.pointerId);
        this.pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
        this.travelled = this.pointers.size === 1 ? 0 : Infinity;
      });
      element.addEventListener("pointermove", (event) => this.#moved(event));
      for (const name of ["pointerup", "pointercancel"]) {
        element.addEventListener(name, (event) => {
          if (!this.pointers.delete(event.pointerId)) return;
          if (name === "pointerup" && this.travelled <= CLICK) this.on.pick(this.#place(event));
        });
      }
      element.addEventListener("pointerleave", () => this.on.point(null));
      element.addEventListener("dblclick", () => this.fit());
    }

    #moved(event) {
      const old = this.pointers.get(event.pointerId);
      if (!old) {
        this.on.point(this.#place(event));
        return;
      }
      const now = { x: event.clientX, y: event.clientY };
      this.pointers.set(event.pointerId, now);
      this.travelled += Math.hypot(now.x - old.x, now.y - old.y);
      if (!this.video || this.travelled <= CLICK) return;
      const other = [...this.pointers].find(([id]) => id !== event.pointerId)?.[1];
      if (other) { // two fingers: they keep what they hold
        const apart = (finger) => Math.max(Math.hypot(finger.x - other.x, finger.y - other.y), 1);
        const { left, top } = this.element.getBoundingClientRect();
        this.zoomBy(apart(now) / apart(old), (now.x + other.x) / 2 - left, (now.y + other.y) / 2 - top);
        this.moveBy((now.x - old.x) / 2, (now.y - old.y) / 2);
      } else {
        this.moveBy(now.x - old.x, now.y - old.y);
      }
    }
  };
}
