// The page of the missing effect: panels as the server writes them, once a second, and buttons that need a word.
"use strict";

const EVERY = 1000; // ms
const element = (id) => document.getElementById(id);
let word = sessionStorage.getItem("word") ?? "";

async function look() {
  try {
    const answer = await fetch("missing/now");
    const html = await answer.text();
    if (element("panels").dataset.shown !== html) {
      element("panels").innerHTML = html;
      element("panels").dataset.shown = html;
    }
  } catch {
    element("said").textContent = "the server does not answer";
  }
}

function asked() {
  return new Promise((resolve) => {
    const dialog = element("ask");
    dialog.addEventListener("close", () => resolve(dialog.returnValue === "go" ? element("word").value.trim() : ""),
      { once: true });
    dialog.showModal();
  });
}

async function press(button, injector, accepted = "") {
  if (!word) word = await asked();
  if (!word) return;
  const body = new URLSearchParams({ button, injector, word, accepted });
  const answer = await fetch("missing/press", { method: "POST", body });
  const text = await answer.text();
  element("said").textContent = text;
  if (answer.status === 428) {
    const typed = prompt(text);
    if (typed) press(button, injector, typed.trim());
    return;
  }
  if (answer.status === 403) word = "";
  sessionStorage.setItem("word", word);
  look();
}

element("panels").addEventListener("click", ({ target }) => {
  const { ask, injector } = target.dataset;
  if (ask) press(ask, injector);
});
setInterval(look, EVERY);
look();
