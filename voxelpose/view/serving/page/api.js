// Requests to the program. Errors carry a line for the user.

const lost = new EventTarget();
let reachable = true;

export function onConnection(call) {
  lost.addEventListener("change", () => call(reachable));
}

function mark(now) {
  if (now !== reachable) {
    reachable = now;
    lost.dispatchEvent(new Event("change"));
  }
}

async function ask(path, options) {
  let answer;
  try {
    answer = await fetch(path, options);
  } catch {
    mark(false);
    throw new Error("the program cannot be reached");
  }
  mark(true);
  const text = await answer.text();
  let content;
  try {
    content = JSON.parse(text);
  } catch {
    content = { error: text.trim() };
  }
  if (!answer.ok) throw new Error(content.error || `the program answered ${answer.status}`);
  return content;
}

export const getJson = (path) => ask(path);

export const postJson = (path, content) =>
  ask(path, {
    method: "POST",
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify(content),
  });

export function loadImage(path) {
  return new Promise((done, failed) => {
    const image = new Image();
    image.onload = () => done(image);
    image.onerror = () => failed(new Error("a picture could not be loaded"));
    image.src = path;
  });
}
