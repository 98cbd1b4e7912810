// The search, and the syntax browser. Everything else works without scripts.
"use strict";

document.documentElement.classList.add("scripted");

// --- Search: the index is a script, so that it can be loaded from a disk, too.

const query = document.getElementById("site-query");
const results = document.getElementById("site-results");
const SHOWN = 14;
const AROUND = 70;
let loading = null;

function loadIndex() {
  loading ??= new Promise((resolve, reject) => {
    const script = document.createElement("script");
    script.src = "search-index.js";
    script.onload = () => resolve(window.GSVC_INDEX);
    script.onerror = reject;
    document.head.append(script);
  });
  return loading;
}

const plain = (text) => text.toLowerCase().normalize("NFKD").replace(/\p{M}/gu, "");

function score(part, words) {
  let total = 0;
  for (const word of words) {
    const [title, page, , text] = part.plain;
    const inTitle = title.includes(word);
    const inText = text.includes(word);
    if (!inTitle && !inText && !page.includes(word)) return 0;
    total += (title === word ? 60 : 0) + (inTitle ? 30 : 0) + (page.includes(word) ? 8 : 0);
    total += inText ? 4 + Math.min(10, text.split(word).length - 1) : 0;
  }
  return total;
}

function found(index, text) {
  const words = plain(text).split(/\s+/).filter(Boolean);
  if (words.length === 0) return [];
  index.parts.forEach((row) => (row.plain ??= row.map(plain)));
  const asIds = [words.join(" "), words.join("_"), `(${words.join(" ")})`];
  const direct = Object.entries(index.ids)
    .filter(([id]) => asIds.includes(plain(id)))
    .map(([id, url]) => [id, "defined here", url, ""]);
  const ranked = index.parts
    .map((row) => [score(row, words), row])
    .filter(([points]) => points > 0)
    .sort((a, b) => b[0] - a[0])
    .map(([, row]) => row);
  return [...direct, ...ranked].slice(0, SHOWN).map((row) => ({ row, words }));
}

function excerpt(text, words) {
  const at = Math.max(0, Math.min(...words.map((word) => plain(text).indexOf(word)).filter((place) => place >= 0), text.length));
  const begin = Math.max(0, at - AROUND);
  const cut = text.slice(begin, at + 2 * AROUND);
  const line = document.createElement("small");
  line.append(begin > 0 ? "… " : "");
  const pattern = new RegExp(`(${words.map((word) => word.replace(/[.*+?^${}()|[\]\\]/g, "\\$&")).join("|")})`, "i");
  for (const [place, piece] of cut.split(pattern).entries()) {
    const node = place % 2 ? document.createElement("mark") : document.createElement("span");
    node.textContent = piece;
    line.append(node);
  }
  return line;
}

function show(entries) {
  results.replaceChildren();
  for (const { row, words } of entries) {
    const item = document.createElement("li");
    const link = document.createElement("a");
    const [title, page, url, text] = row;
    link.href = url;
    const name = document.createElement("b");
    name.textContent = title;
    const where = document.createElement("i");
    where.textContent = page === title ? "" : page;
    link.append(name, where);
    if (text) link.append(excerpt(text, words));
    item.append(link);
    results.append(item);
  }
  if (entries.length === 0) {
    const none = document.createElement("li");
    none.className = "none";
    none.textContent = "Nothing has all of these words.";
    results.append(none);
  }
  results.hidden = query.value.trim() === "";
}

async function search() {
  const text = query.value;
  const index = await loadIndex();
  if (text === query.value) show(found(index, text));
}

function move(step) {
  const links = [...results.querySelectorAll("a")];
  const next = links.indexOf(document.activeElement) + step;
  if (next < 0) query.focus();
  else links[Math.min(next, links.length - 1)]?.focus();
}

query.addEventListener("focus", loadIndex, { once: true });
query.addEventListener("input", search);
document.addEventListener("keydown", (event) => {
  const inSearch = event.target === query || results.contains(event.target);
  if (event.key === "/" && !inSearch && !event.ctrlKey && !event.metaKey && !event.altKey) {
    event.preventDefault();
    query.focus();
  } else if (inSearch && (event.key === "ArrowDown" || event.key === "ArrowUp")) {
    event.preventDefault();
    move(event.key === "ArrowDown" ? 1 : -1);
  } else if (event.key === "Enter" && event.target === query) {
    results.querySelector("a")?.click();
  } else if (event.key === "Escape" && inSearch) {
    results.hidden = true;
    query.focus();
  }
});
document.addEventListener("click", (event) => {
  if (!event.target.closest(".search") || event.target.closest("#site-results a")) results.hidden = true;
});

// --- Syntax browser: one text at a time.

const about = document.querySelector(".browser .about");

function choose() {
  const article = location.hash.startsWith("#about-") && document.getElementById(location.hash.slice(1));
  for (const one of about.querySelectorAll("article")) one.classList.toggle("chosen", one === article);
  about.classList.toggle("has-chosen", Boolean(article));
  for (const link of document.querySelectorAll(".tables a")) {
    link.toggleAttribute("aria-current", article && link.getAttribute("href") === location.hash);
  }
}

if (about) {
  document.querySelector(".tables").addEventListener("click", (event) => {
    const link = event.target.closest('a[href^="#about-"]');
    if (!link) return;
    event.preventDefault(); // the tables stay where they are
    history.replaceState(null, "", link.getAttribute("href"));
    choose();
  });
  addEventListener("hashchange", choose);
  choose();
  document.querySelector(".tables a[aria-current]")?.scrollIntoView({ block: "center" });
}
