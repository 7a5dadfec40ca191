"use strict";
// One stream of events, orders by POST. Text of the bench is set as text, never as markup.
(() => {
  const MOST_ROWS = 200;
  const MOST_CELLS = 6000;
  const MOST_NOTES = 6;
  const token = location.hash.slice(1);
  const by = (id) => document.getElementById(id);
  const make = (name, parent, text, kind) => {
    const element = document.createElement(name);
    if (text !== undefined) element.textContent = text;
    if (kind) element.className = kind;
    parent.append(element);
    return element;
  };
  let scene = null;
  let last = null;
  let paused = false;
  let held = 0;

  const say = (text, kind) => {
    by("said").textContent = text;
    by("said").className = "said " + (kind || "");
  };
  const linked = (text, kind) => {
    by("link").textContent = text;
    by("link").className = kind;
  };

  const order = async (path, body) => {
    try {
      const answer = await fetch(path, {
        method: "POST",
        headers: { "Content-Type": "application/json", "Drivebench-Token": token },
        body: JSON.stringify(body),
      });
      say((await answer.text()).trim(), answer.ok ? "good" : "bad");
    } catch {
      say("The bench does not answer.", "bad");
    }
  };
  const inject = (place) => {
    const fault = document.querySelector("#faults input:checked");
    if (fault) order("/fault", { place, fault: Number(fault.value) });
  };

  const heads = (table, names) => {
    const row = make("tr", table.tHead);
    for (const name of names) make("th", row, name).scope = "col";
    return row;
  };

  const show = (own) => {
    const again = JSON.stringify(own);
    if (scene && JSON.stringify(scene) === again) return;
    if (scene) location.reload();
    scene = own;
    by("title").textContent = own.title;
    document.title = own.title + " - drivebench";
    if (own.read_only) {
      by("read-only").textContent = own.read_only;
      by("read-only").hidden = false;
    }
    heads(by("stations"), own.stations);
    heads(by("traffic"), own.traffic);
    by("traffic-s").hidden = own.traffic.length === 0;
    if (!own.picture) document.querySelector("main").className = "tables";
    const orders = !own.read_only && own.faults.length > 0;
    by("control").hidden = !orders;
    if (orders) {
      own.faults.forEach((words, number) => {
        const label = make("label", by("faults"));
        const input = make("input", label);
        input.type = "radio";
        input.name = "fault";
        input.value = number;
        input.checked = number === 0;
        label.append(" " + words);
      });
      own.scripts.forEach((words, script) => {
        const button = make("button", by("scripts"), words);
        button.type = "button";
        button.addEventListener("click", () => order("/play", { script }));
      });
    }
    const columns = own.picture ? own.picture.columns : [];
    const button = (place, parent, words) => {
      const button = make("button", parent, words);
      button.type = "button";
      button.title = "Inject the fault: " + own.places[place].name;
      button.addEventListener("click", () => inject(place));
    };
    if (own.picture) {
      by("picture").hidden = false;
      by("picture-h").textContent = own.picture.heading;
      by("picture-note").textContent = own.picture.note;
      for (const [kind, words] of own.picture.legend) {
        const entry = make("li", by("legend"));
        make("i", entry, undefined, kind);
        entry.append(words);
      }
      const row = heads(by("rows"), ["time"]);
      columns.forEach((name, column) => {
        const head = make("th", row);
        head.scope = "col";
        const place = orders ? own.places.findIndex((place) => place.column === column) : -1;
        if (place < 0) head.textContent = name;
        else button(place, head, name);
      });
      make("th", row, "", "words").scope = "col";
    }
    if (orders) {
      const free = own.places.map((place, number) => [place, number]).filter(([place]) => place.column === null);
      for (const [place, number] of free) button(number, by("places"), "Inject: " + place.name);
      if (free.length) document.querySelector("main").className = "shared";
      by("places-note").textContent = free.length
        ? "The fault waits until that one begins."
        : "Press a link in the head of the picture: the fault meets the next byte on it.";
    }
  };

  const tell = (text) => {
    by("notes-s").hidden = false;
    make("li", by("notes"), text);
    while (by("notes").children.length > MOST_NOTES) by("notes").firstChild.remove();
  };

  const line = (text) => {
    const row = make("tr", by("rows").tBodies[0]);
    row.className = "fold";
    const cell = make("td", row, text);
    cell.colSpan = (scene.picture ? scene.picture.columns.length : 0) + 1;
    return row;
  };

  const draw = (own) => {
    const body = by("rows").tBodies[0];
    if (own.fold > 0) {
      const before = body.lastElementChild;
      const same = before && before.dataset.words === own.words;
      const folded = own.fold + (same ? Number(before.dataset.fold) : 0);
      const row = same ? before : line("");
      row.dataset.fold = folded;
      row.dataset.words = own.words;
      row.firstChild.textContent = "... " + folded + " " + scene.picture.folded[folded === 1 ? 0 : 1] + ": " + own.words;
      return;
    }
    const row = make("tr", body);
    make("th", row, own.at).scope = "row";
    const cells = new Map(own.cells.map(([column, text, kind]) => [column, [text, kind]]));
    for (let column = 0; column < scene.picture.columns.length; column++) {
      const [text, kind] = cells.get(column) || ["", ""];
      make("td", row, text, kind);
    }
    make("td", row, own.words, "words");
  };

  const trim = () => {
    const body = by("rows").tBodies[0];
    const columns = scene.picture.columns.length;
    const most = Math.max(40, Math.min(MOST_ROWS, Math.floor(MOST_CELLS / (columns + 2))));
    while (body.rows.length > most) body.rows[0].remove();
  };

  const fill = (table, rows) => {
    const body = table.tBodies[0];
    while (body.rows.length > rows.length) body.lastElementChild.remove();
    rows.forEach((cells, number) => {
      const row = body.rows[number] || make("tr", body);
      cells.forEach((text, column) => {
        const cell = row.cells[column];
        if (!cell) {
          make(column === 0 ? "th" : "td", row, text);
        } else if (cell.textContent !== text) {
          cell.textContent = text;
          cell.classList.remove("changed");
          if (table.id === "stations") requestAnimationFrame(() => cell.classList.add("changed"));
        }
      });
    });
  };

  const news = (own) => {
    by("at").textContent = own.at;
    by("master").textContent = scene.picture && scene.faults.length ? (own.master ? "A master is connected." : "") : "";
    if (own.stations.length) fill(by("stations"), own.stations);
    if (own.traffic.length) fill(by("traffic"), own.traffic);
    for (const text of own.notes) tell(own.at + ": " + text);
    if (!scene.picture) return;
    if (paused) {
      held += own.rows.length + own.left_out;
      by("pause").textContent = "Go on (" + held + " rows not shown)";
      return;
    }
    const scroll = by("scroll");
    const below = scroll.scrollHeight - scroll.scrollTop - scroll.clientHeight < 40;
    const left = own.left_out + Math.max(0, own.rows.length - MOST_ROWS);
    if (left) line("... " + left + " rows left out: more than a page can show");
    own.rows.slice(-MOST_ROWS).forEach(draw);
    trim();
    if (below && (own.rows.length || left)) scroll.scrollTop = scroll.scrollHeight;
  };

  const event = (kind, id, data) => {
    if (kind === "scene") show(JSON.parse(data));
    if (kind === "left-out") tell(data + " events left out: this page was too slow, or away for too long.");
    if (kind === "news" && scene) news(JSON.parse(data));
    if (id !== null) last = id;
  };

  // The stream of events (HTML, "Server-sent events"), read by fetch because an EventSource sends no header with a token.
  const read = async (stream) => {
    const reader = stream.pipeThrough(new TextDecoderStream()).getReader();
    let text = "";
    for (;;) {
      const { done, value } = await reader.read();
      if (done) return;
      text += value;
      for (let end = text.indexOf("\n\n"); end >= 0; end = text.indexOf("\n\n")) {
        let kind = "message";
        let id = null;
        const data = [];
        for (const field of text.slice(0, end).split("\n")) {
          if (field.startsWith("event: ")) kind = field.slice(7);
          if (field.startsWith("id: ")) id = field.slice(4);
          if (field.startsWith("data: ")) data.push(field.slice(6));
        }
        text = text.slice(end + 2);
        if (data.length) event(kind, id, data.join("\n"));
      }
    }
  };

  const connect = async () => {
    for (let wait = 500; ; wait = Math.min(wait * 2, 8000)) {
      try {
        const headers = { "Drivebench-Token": token };
        if (last !== null) headers["Last-Event-ID"] = last;
        const answer = await fetch("/events", { headers, cache: "no-store" });
        if (answer.status === 403) {
          linked((await answer.text()).trim(), "bad");
          return;
        }
        if (!answer.ok) throw new Error((await answer.text()).trim());
        linked("Live.", "good");
        wait = 250;
        await read(answer.body);
        linked("The stream has ended; connecting again.", "bad");
      } catch (error) {
        linked("No connection to the bench; trying again. " + (error instanceof TypeError ? "" : error.message), "bad");
      }
      await new Promise((done) => setTimeout(done, wait));
    }
  };

  by("pause").addEventListener("click", () => {
    paused = !paused;
    by("pause").setAttribute("aria-pressed", String(paused));
    by("pause").textContent = paused ? "Go on" : "Pause";
    if (!paused && held) line("... " + held + " rows not shown while the page was paused");
    held = 0;
  });
  by("clear").addEventListener("click", () => {
    by("rows").tBodies[0].replaceChildren();
    by("notes").replaceChildren();
    by("notes-s").hidden = true;
    say("");
  });
  if (token) connect();
  else linked("The token is missing; open the address that drivebench printed, with what stands behind its #.", "bad");
})();
