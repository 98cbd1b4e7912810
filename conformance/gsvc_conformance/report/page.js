"use strict";
{
  const all = (selector, within = document) => [...within.querySelectorAll(selector)];
  const faults = all("details.fault").map((element) => entry(element, element.id, element.dataset.outcome));
  const rows = all("#vectors tbody tr").map((element) => {
    const [name, outcome] = element.cells;
    return entry(element, name.textContent, outcome.textContent);
  });
  const form = document.querySelector("form.filter");
  const MOST_OPENED = 40; // failures that a filter leaves, so that their operations are opened

  function entry(element, id, outcome) {
    const [tier, operation] = id.split("/");
    return { element, tier, operation, outcome, text: "" };
  }

  function holds(item, values, words) {
    item.text ||= `${item.element.id} ${item.element.textContent}`.toLowerCase();
    const same = (name) => !values[name] || values[name] === item[name];
    return same("outcome") && same("operation") && same("tier") && words.every((word) => item.text.includes(word));
  }

  function choose(items, values, words) {
    let left = 0;
    for (const item of items) {
      const shown = holds(item, values, words);
      item.element.hidden = !shown;
      left += shown;
    }
    return left;
  }

  function filter() {
    const values = Object.fromEntries(new FormData(form));
    const words = values.text.toLowerCase().split(/\s+/).filter(Boolean);
    const narrow = words.length > 0 || Boolean(values.outcome || values.operation || values.tier);
    const wrong = choose(faults, values, words);
    const vectors = choose(rows, values, words);
    for (const group of all("details.group")) {
      const inside = all("details.fault", group);
      if (inside.length === 0) continue; // a cause
      group.hidden = inside.every((element) => element.hidden);
      if (narrow && wrong <= MOST_OPENED && !group.hidden) group.open = true;
    }
    const count = (left, items, what) => (items.length ? [`${left} of ${items.length} ${what}`] : []);
    const parts = [...count(wrong, faults, "failures"), ...count(vectors, rows, "vectors")];
    form.querySelector("output").textContent = narrow ? parts.join(", ") : "";
  }

  function reveal() { // what a link leads to, and the folds around it
    const target = document.getElementById(decodeURIComponent(location.hash.slice(1)));
    if (!target) return;
    if (target.hidden || target.closest("[hidden]")) {
      form.reset();
      filter();
    }
    for (let fold = target; fold; fold = fold.parentElement?.closest("details")) fold.open = true;
    target.scrollIntoView();
  }

  async function copy(button, text) {
    try {
      await navigator.clipboard.writeText(text);
      button.textContent = "copied";
    } catch {
      getSelection().selectAllChildren(button.parentElement.firstElementChild);
      button.textContent = "press Ctrl-C";
    }
    setTimeout(() => { button.textContent = "copy"; }, 1500);
  }

  for (const command of all("pre.command")) {
    const text = document.createElement("code");
    text.append(...command.childNodes);
    const button = document.createElement("button");
    button.type = "button";
    button.className = "copy";
    button.textContent = "copy";
    button.addEventListener("click", () => copy(button, text.textContent));
    command.append(text, button);
  }
  form.hidden = false;
  form.addEventListener("input", filter);
  form.addEventListener("submit", (event) => event.preventDefault());
  for (const button of all("button[name]", form)) {
    const open = button.name === "open";
    button.addEventListener("click", () => all("details.group, details.fault").forEach((fold) => {
      fold.open = open && !fold.hidden;
    }));
  }
  addEventListener("hashchange", reveal);
  filter();
  reveal();
}
