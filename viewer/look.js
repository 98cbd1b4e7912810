"use strict";
// The splat at a place of the picture, or the one that is followed: what is told of it.
globalThis.GSVC ??= {};

{
  const { element, tell } = GSVC.words;
  const $ = (id) => document.getElementById(id);
  const POINT = "Point at the picture to see which splat is there; click to follow it.";
  const FOLLOWED = "Followed from frame to frame; click it again to let it go.";

  GSVC.Look = class {
    /** @param {function(): number} number where the frame that is shown stands in its stream */
    constructor(screen, number) {
      Object.assign(this, { screen, number, stream: null, track: null, point: null });
    }

    /** Look at another stream from now on. */
    begin(stream) {
      Object.assign(this, { stream, track: null, point: null });
    }

    /** Somebody points at a place of the frame, or (null) at none. */
    at(place) {
      this.point = place;
      this.again();
    }

    /** Tell about the splat that is followed, or else of the one under the pointer. */
    again() {
      const { screen, point, track } = this;
      if (!screen.frame) return;
      const { parameters, origins } = screen.frame;
      const found = point && GSVC.splats.lookAt(parameters, point.x, point.y);
      const index = track ? track.indexIn(this.number()) : found ? found.index : -1;
      screen.followed = { index: track ? index ?? -1 : -1, points: track ? track.points() : [] };
      screen.pointed = found ? found.index : -1;
      screen.marksChanged();
      this.#tip(found, point);
      const facts = index !== null && index >= 0 ? GSVC.panels.splatFacts(parameters, index, origins[index] < 0) : [];
      if (index === null) facts.push(["splat", "followed; too many frames away"]);
      else if (track && index < 0) facts.push(["splat", "followed; not in this frame"]);
      if (found && !track) facts.push(...GSVC.panels.placeFacts(found, point));
      const hint = element("p", { class: "hint" }, track ? FOLLOWED : POINT);
      const list = element("dl", { class: "facts" });
      tell(list, facts);
      $("splat").replaceChildren(...(facts.length ? [list, hint] : [hint]));
    }

    #tip(found, point) {
      $("tip").hidden = !found || found.index < 0;
      if ($("tip").hidden) return;
      $("tip").textContent = `splat ${found.index} · ${found.covering} here`;
      const [x, y] = point.onPage;
      const room = $("screen").clientWidth - $("tip").offsetWidth - 4;
      $("tip").style.transform = `translate(${Math.max(Math.min(x + 14, room), 4)}px, ${y + 18}px)`;
    }

    /** Follow the splat at a place; the one that is followed is let go. */
    follow(place) {
      const { screen } = this;
      if (!screen.frame) return;
      const { index } = GSVC.splats.lookAt(screen.frame.parameters, place.x, place.y);
      const same = this.track && index === this.track.indexIn(this.number());
      this.track = index < 0 || same ? null : new GSVC.splats.Track(this.stream, this.number(), index);
      this.at(place);
    }

    letGo() {
      this.track = null;
      this.again();
    }
  };
}
