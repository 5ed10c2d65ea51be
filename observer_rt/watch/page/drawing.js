// Draws the parts of a message, and says so once they are on the screen. Nothing of them goes back to the server.
const entries = (each) => (each instanceof Map ? [...each] : Object.entries(each));
const changed = (part) => {
  if (typeof part === "string") return { text: part };
  return Array.isArray(part) ? { start: part[0], end: part[1] } : { data: part };
};
const content = new Map(entries(message.content));
const named = new Map(entries(targets));
for (const [name, part] of entries(content.get("parts"))) {
  named.get(name).setv(changed(part), { sync: false });
}
requestAnimationFrame(() => { message.drawn = content.get("number"); });
