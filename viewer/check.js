"use strict";
// The tab in which the page judges itself by the golden vectors.
globalThis.GSVC ??= {};

{
  const { element, number } = GSVC.words;
  const FOLDER = "../vectors/"; // in a checkout
  const CHECKS = { // the answers that spec.md 13.2 accepts
    exact: "the same bits",
    decision: "the same number, or the recorded alternative",
    bounded: "within the bound of each element",
    interval: "between the lowest and the highest number",
    refusal: "the same kind of error",
    encoding: "a stream that does what was asked for",
    rate: "the size of the stream beside it",
  };
  const WORDS = { passed: "passed", failed: "failed", incomplete: "incomplete", "not claimed": "not done here" };

  const cell = (text, attributes = {}) => element("td", attributes, text);

  function operationRow(row) {
    const verdict = row.wrong > 0 ? "failed" : row.passed === row.vectors ? "passed"
      : row.passed > 0 ? "incomplete" : "not claimed";
    const told = row.wrong > 0 ? `${number(row.wrong)} wrong` : WORDS[verdict];
    return element("tr", { class: verdict.replace(" ", "-") },
      element("th", { scope: "row" }, row.operation),
      cell(told, { class: "verdict" }),
      cell(`${number(row.passed)} of ${number(row.vectors)}`, { class: "count" }),
      cell(row.checks.join(", "), { title: row.checks.map((check) => CHECKS[check]).join(", ") }),
      cell(row.ratio === null ? "" : number(row.ratio, 3), { class: "count" }),
      cell(row.group));
  }

  function table(rows) {
    const heads = [["operation"], ["verdict"], ["right", "count"], ["check"], ["error / bound", "count"], ["class"]];
    const cells = heads.map(([text, name = ""]) => element("th", { scope: "col", class: name }, text));
    const head = element("thead", {}, element("tr", {}, ...cells));
    const body = element("tbody", {}, ...rows.map(operationRow));
    return element("div", { class: "scroll" }, element("table", {}, head, body));
  }

  const classItem = ({ name, verdict }) =>
    element("li", { class: verdict.replace(" ", "-") }, `${name}: ${WORDS[verdict]}`);

  function failure({ id, title, reason, message }) {
    return element("li", {}, element("code", {}, id), ` ${title} ${reason} `, element("b", {}, message));
  }

  GSVC.CheckTab = class {
    /**
     * @param {HTMLElement} root
     * @param {function(): string} kind of the renderer to be judged
     * @param {boolean} served whether the server that the page came from has the vectors
     */
    constructor(root, kind, served) {
      Object.assign(this, { root, kind });
      this.button = element("button", { class: "primary", id: "run-check" }, "Check");
      this.stop = element("button", { id: "stop-check", hidden: "" }, "Stop");
      this.choose = element("input", { type: "file", id: "vectors", webkitdirectory: "", multiple: "" });
      const progress = { id: "check-progress", max: 1, value: 0, hidden: "", "aria-label": "Progress of the check" };
      this.bar = element("progress", progress);
      this.result = element("div", { id: "check-result" });
      const intro = "Every answer of this decoder is compared with those that spec.md allows: the golden vectors. ";
      const how = served ? "" : "They are not where this page may look for them: choose their folder, or drop it here.";
      const look = `button${served ? "" : " primary"}`;
      const folder = element("label", { class: look }, "Choose the folder vectors", this.choose);
      root.append(element("h2", {}, "Is it right?"), element("p", {}, intro, how),
        element("p", { class: "actions" }, ...(served ? [this.button] : []), folder, this.stop), this.bar, this.result,
        this.status = element("p", { class: "hidden", role: "status" }));
      this.button.addEventListener("click", () => this.run(() => GSVC.vectorsAt(FOLDER)));
      this.choose.addEventListener("change", () => {
        const files = [...this.choose.files];
        this.choose.value = ""; // so that the same folder can be chosen again
        this.run(() => GSVC.vectorsAmong(files));
      });
      this.stop.addEventListener("click", () => this.running?.abort());
    }

    /** Judge by the vectors that `find` gives a promise of. */
    async run(find) {
      if (this.running) return;
      this.running = new AbortController();
      this.button.disabled = this.choose.disabled = true;
      this.stop.hidden = this.bar.hidden = false;
      this.bar.value = 0;
      this.result.replaceChildren("Reading …");
      this.status.textContent = "Reading";
      let renderer = null;
      try {
        renderer = await GSVC.createRenderer(this.kind(), null).catch(() => null);
        GSVC.renderer = renderer; // the one that the operations use
        const report = await GSVC.selfCheck(await find(), {
          signal: this.running.signal,
          onProgress: ({ done, total }) => {
            this.bar.value = done / total;
          },
        });
        this.#show(report, renderer);
      } catch (error) {
        this.result.replaceChildren(
          element("p", { class: "notice", role: "alert" }, `It could not be checked: ${error.message}`));
      } finally {
        renderer?.destroy();
        GSVC.renderer = null;
        this.running = null;
        this.button.disabled = this.choose.disabled = false;
        this.stop.hidden = this.bar.hidden = true;
      }
    }

    #show({ rows, classes, failures, complete, verified, seconds }, renderer) {
      const judged = rows.reduce((sum, { passed, wrong }) => sum + passed + wrong, 0);
      const verdict = failures.length > 0 ? "failed" : judged > 0 ? "passed" : "none";
      const right = {
        failed: `${number(failures.length)} of ${number(judged)} answers are wrong`,
        passed: `All ${number(judged)} answers${complete ? "" : " so far"} are right`,
        none: "No answer was judged",
      }[verdict];
      const answer = `${right}, in ${number(seconds, 1)} s.`;
      const incomplete = classes.some((group) => group.verdict === "incomplete");
      this.status.textContent = answer;
      const notes = [
        complete ? "" : "It was stopped before the end.",
        incomplete ? "A class is incomplete unless all of its vectors, those that SHA256SUMS lists, were judged." : "",
        verified ? "The files are those that SHA256SUMS lists." : "The files were not compared with SHA256SUMS.",
        renderer ? `Drawn by ${renderer.description}.` : "No renderer works here: what is drawn by one was left out.",
      ];
      this.result.replaceChildren(
        element("p", { class: `answer ${verdict}` }, answer),
        element("p", {}, notes.filter(Boolean).join(" ")),
        element("ul", { class: "classes" }, ...classes.map(classItem)),
        table(rows),
        ...(failures.length ? [element("h3", {}, "Wrong answers"), element("ul", {}, ...failures.map(failure))] : []),
      );
    }
  };
}
