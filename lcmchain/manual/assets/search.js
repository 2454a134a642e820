// Pages that hold every word typed, those with a word in the title first, each with its context.
const field = document.getElementById("manual-search");
const found = document.getElementById("manual-found");
const contents = document.getElementById("manual-contents");

field.addEventListener("input", () => {
  const words = field.value.toLowerCase().split(/\s+/).filter(Boolean);
  contents.hidden = words.length > 0;
  found.replaceChildren();
  if (!words.length) return;
  const hits = pages
    .map(([topic, title, text]) => {
      const lower = text.toLowerCase();
      const inTitle = words.filter((word) => title.toLowerCase().includes(word)).length;
      const matches = words.every((word) => lower.includes(word));
      return { topic, title, text, place: lower.indexOf(words[0]), inTitle, matches };
    })
    .filter((hit) => hit.matches)
    .sort((a, b) => b.inTitle - a.inTitle);
  for (const hit of hits) {
    const link = document.createElement("a");
    link.href = `${hit.topic}.html#:~:text=${encodeURIComponent(words[0])}`;
    link.textContent = hit.title;
    const context = document.createElement("p");
    const start = Math.max(0, hit.place - 40);
    context.textContent = `… ${hit.text.slice(start, hit.place + 80)} …`;
    const item = document.createElement("li");
    item.append(link, context);
    found.append(item);
  }
  if (!hits.length) found.append("nothing found");
});
