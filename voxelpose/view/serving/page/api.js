// Requests to the program. Errors carry a line for the user.

let reachable = true;
let told = () => {};

// A file that is dropped where none is taken does not lead the browser away from the page.
for (const kind of ["dragover", "drop"]) addEventListener(kind, (event) => event.dataTransfer.types.includes("Files") && event.preventDefault());

// Calls whenever the program cannot be reached any more, or again.
export const onConnection = (call) => (told = call);

function mark(now) {
  if (now !== reachable) told(now);
  reachable = now;
}

async function ask(path, options) {
  let answer;
  try {
    answer = await fetch(path, options);
  } catch {
    mark(false);
    throw new Error("the program has ended or cannot be reached: start it again");
  }
  mark(true);
  const text = await answer.text();
  let content;
  try {
    content = JSON.parse(text);
  } catch {
    content = { error: text.trim() };
  }
  if (!answer.ok) throw Object.assign(new Error(content.error || `the program answered ${answer.status}`), { field: content.field });
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
