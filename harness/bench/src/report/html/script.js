"use strict";
// The page stands without this. It shows what the byte under the pointer or the cursor is, zooms, and lays bytes out at their times.
(() => {
  const SVG = "http://www.w3.org/2000/svg";
  const MS = 3e6; // thirds of a nanosecond
  const TALLEST = 30000;
  const make = (name, parent, attributes, text) => {
    const element = parent.namespaceURI === SVG || name === "g" ? document.createElementNS(SVG, name) : document.createElement(name);
    for (const [key, value] of Object.entries(attributes || {})) element.setAttribute(key, value);
    if (text !== undefined) element.textContent = text;
    parent.append(element);
    return element;
  };
  const tip = make("div", document.body, { class: "tip", hidden: "" });

  const ring = (root) => {
    const data = JSON.parse(root.querySelector("script").textContent);
    const scroll = root.querySelector(".scroll");
    const svg = root.querySelector("svg");
    const byIndex = svg.querySelector(".by-index");
    const width = svg.viewBox.baseVal.width;
    const height = svg.viewBox.baseVal.height;
    const count = data.links.length;
    const state = { zoom: 1, time: null, link: -1, row: -1 };

    // Which area a byte is in, counted from 1; 0 where there is none.
    const grid = new Int32Array(count * data.rows);
    for (let at = 0; at < data.areas.length; at += 8) {
      const [link, links, row, rows] = data.areas.slice(at, at + 4);
      for (let l = link; l < link + links; l++) grid.fill(at / 8 + 1, l * data.rows + row, l * data.rows + row + rows);
    }
    const area = (link, row) => {
      if (link < 0 || link >= count || row < 0 || row >= data.rows) return null;
      const number = grid[link * data.rows + row];
      return number ? data.areas.slice(number * 8 - 8, number * 8) : null;
    };

    // When each byte of a link had passed.
    const ends = data.times.map((runs) => {
      const all = [];
      let t = 0;
      for (let i = 0; i < runs.length; i += 2) {
        t += runs[i];
        all.push(t);
        for (let n = 1; n < runs[i + 1]; n++) all.push((t += data.byte));
      }
      return all;
    });

    const describe = (link, row) => {
      const own = area(link, row);
      if (!own) return "";
      const [status, meaning, remark] = own.slice(5).map((number) => data.texts[number]);
      const at = ends[link][row];
      const time = at === undefined ? "" : ", " + (at / MS).toFixed(3) + " ms";
      const differs = data.differs && data.differs[0] === link && data.differs[1] === row ? "The first byte that differs. " : "";
      const fault = own[4] < 0 ? "Fault. " : "";
      return differs + fault + data.links[link] + ", byte " + (data.first + row + 1) + time + ": " + status + "\n" + meaning +
        (remark ? "\nthe drive: " + remark : "");
    };

    // Where a byte stands in the picture.
    const place = (link, row) => {
      const x = data.left + link * data.column;
      if (!state.time) return [x, data.top + row * data.row, data.column, data.row];
      const end = ends[link][row];
      const { from, unit } = state.time;
      return [x, data.top + Math.max(0, end - data.byte - from) / unit, data.column, data.byte / unit];
    };
    // Which byte stands at a place of the picture.
    const find = (x, y) => {
      const link = Math.floor((x - data.left) / data.column);
      if (link < 0 || link >= count) return null;
      if (!state.time) {
        const row = Math.floor((y - data.top) / data.row);
        return area(link, row) ? [link, row] : null;
      }
      const at = state.time.from + (y - data.top) * state.time.unit;
      const all = ends[link];
      let low = 0;
      let high = all.length;
      while (low < high) {
        const middle = (low + high) >> 1;
        if (all[middle] < at) low = middle + 1;
        else high = middle;
      }
      return low < all.length && all[low] - data.byte <= at && area(link, low) ? [link, low] : null;
    };

    // The picture by time: the same colours, each link for itself, gaps left free.
    const byTime = () => {
      let from = Infinity;
      let until = 0;
      for (const all of ends) if (all.length) (from = Math.min(from, all[0] - data.byte)), (until = Math.max(until, all[all.length - 1]));
      from = Math.max(0, from);
      const unit = Math.max(data.byte / 8, (until - from) / TALLEST);
      const paths = {};
      for (let at = 0; at < data.areas.length; at += 8) {
        const [link, links, row, rows, coded] = data.areas.slice(at, at + 5);
        const colour = "abcdefg"[coded < 0 ? -1 - coded : coded];
        for (let l = link; l < link + links; l++) {
          let first = row;
          for (let r = row + 1; r <= row + rows; r++) {
            if (r < row + rows && ends[l][r] - ends[l][r - 1] < 2 * data.byte) continue;
            if (ends[l][r - 1] === undefined) break;
            const x = data.left + l * data.column;
            const top = data.top + Math.max(0, ends[l][first] - data.byte - from) / unit;
            const high = Math.max(0.4, data.top + (ends[l][r - 1] - from) / unit - top);
            const shape = "M" + x + " " + top.toFixed(1) + "h" + (data.column - 1) + "v" + high.toFixed(1) + "h-" + (data.column - 1) + "z";
            paths[colour] = (paths[colour] || "") + shape;
            if (coded < 0) paths.x = (paths.x || "") + shape;
            first = r;
          }
        }
      }
      const group = make("g", svg, { class: "by-time" });
      for (const colour of Object.keys(paths).sort()) make("path", group, { class: colour, d: paths[colour] });
      const tall = (until - from) / unit;
      const step = 40 * Math.max(1, Math.ceil(tall / 4000));
      for (let y = 0; y <= tall; y += step) {
        make("text", group, { class: "e", x: data.left - 8, y: data.top + y + 4 }, ((from + y * unit) / MS).toFixed(2));
      }
      make("text", group, { class: "e", x: data.left - 8, y: 12 }, "ms");
      return { group, from, unit, height: data.top + tall + 12 };
    };

    const size = () => {
      const high = state.time ? state.time.height : height;
      svg.setAttribute("viewBox", "0 0 " + width + " " + high);
      svg.setAttribute("width", width * state.zoom);
      svg.setAttribute("height", high * state.zoom);
    };
    const zoom = (factor) => {
      const middle = (scroll.scrollTop + scroll.clientHeight / 2) / state.zoom;
      state.zoom = factor === 0 ? Math.min(1, scroll.clientWidth / width) : Math.min(8, Math.max(0.25, state.zoom * factor));
      size();
      scroll.scrollTop = middle * state.zoom - scroll.clientHeight / 2;
    };

    const cursor = make("rect", svg, { class: "cursor", visibility: "hidden" });
    const mark = (link, row) => {
      const [x, y, w, h] = place(link, row);
      for (const [key, value] of Object.entries({ x, y, width: w, height: Math.max(h, 2), visibility: "visible" })) cursor.setAttribute(key, value);
      svg.append(cursor);
      return [x, y, w, h];
    };
    const hide = () => tip.setAttribute("hidden", "");
    const show = (link, row, x, y) => {
      tip.textContent = describe(link, row);
      tip.removeAttribute("hidden");
      const box = tip.getBoundingClientRect();
      tip.style.left = Math.max(4, Math.min(x + 14, innerWidth - box.width - 8)) + "px";
      tip.style.top = (y + 18 + box.height > innerHeight ? Math.max(4, y - box.height - 10) : y + 18) + "px";
    };

    const tools = make("div", root, { class: "tools", role: "group", "aria-label": "The diagram" });
    const button = (text, label, act) => {
      const element = make("button", tools, { type: "button", "aria-label": label }, text);
      element.addEventListener("click", act);
      return element;
    };
    button("+", "Zoom in", () => zoom(1.5));
    button("\u2212", "Zoom out", () => zoom(1 / 1.5));
    button("fit", "Fit to the width", () => zoom(0));
    const toggle = button("at their times", "Bytes at their times", () => {
      if (state.time) {
        state.time.group.remove();
        state.time = null;
      } else state.time = byTime();
      byIndex.setAttribute("display", state.time ? "none" : "inline");
      toggle.setAttribute("aria-pressed", String(!!state.time));
      hide();
      size();
      if (state.link >= 0) go(state.link, state.row);
    });
    toggle.setAttribute("aria-pressed", "false");
    button("next", "Go to the next fault, or to the byte that differs", () => fault());
    const help = make("span", tools, { class: "note", id: svg.getAttribute("aria-labelledby").split(" ")[0] + "h" },
      "Keys: arrows, Page Up and Down, Home, End; f next fault or byte that differs, t times, + and \u2212 zoom, Escape.");
    root.prepend(tools);
    const said = make("p", root, { class: "said", role: "status" });
    scroll.after(said);
    scroll.setAttribute("role", "application");
    scroll.setAttribute("aria-describedby", help.id);

    // Moves the cursor to a byte, and says what it is.
    const go = (link, row) => {
      link = Math.max(0, Math.min(count - 1, link));
      row = Math.max(0, Math.min(data.rows - 1, row));
      while (row > 0 && !area(link, row)) row--;
      if (!area(link, row)) return;
      state.link = link;
      state.row = row;
      const [x, y, w, h] = mark(link, row).map((value) => value * state.zoom);
      if (x < scroll.scrollLeft || x + w > scroll.scrollLeft + scroll.clientWidth) scroll.scrollLeft = x - scroll.clientWidth / 2;
      if (y < scroll.scrollTop || y + h > scroll.scrollTop + scroll.clientHeight) scroll.scrollTop = y - scroll.clientHeight / 2;
      said.textContent = describe(link, row);
      const box = svg.getBoundingClientRect();
      show(link, row, box.left + x + w, box.top + y);
    };
    const fault = () => {
      const all = [];
      for (let at = 0; at < data.areas.length; at += 8) if (data.areas[at + 4] < 0) all.push([data.areas[at], data.areas[at + 2]]);
      if (data.differs) all.push(data.differs);
      all.sort((a, b) => a[1] - b[1] || a[0] - b[0]);
      const next = all.find(([link, row]) => row > state.row || (row === state.row && link > state.link)) || all[0];
      if (next) go(next[0], next[1]);
      else said.textContent = "There is no fault.";
    };

    const keys = {
      ArrowLeft: () => go(state.link - 1, state.row),
      ArrowRight: () => go(state.link + 1, state.row),
      ArrowUp: () => go(state.link, state.row - 1),
      ArrowDown: () => go(state.link, state.row + 1),
      PageUp: () => go(state.link, state.row - 20),
      PageDown: () => go(state.link, state.row + 20),
      Home: () => go(state.link, 0),
      End: () => go(state.link, data.rows - 1),
      Escape: hide,
      f: fault,
      t: () => toggle.click(),
      "+": () => zoom(1.5),
      "=": () => zoom(1.5),
      "-": () => zoom(1 / 1.5),
      0: () => zoom(0),
    };
    scroll.addEventListener("keydown", (event) => {
      const act = event.ctrlKey || event.altKey || event.metaKey ? null : keys[event.key];
      if (!act) return;
      event.preventDefault();
      if (state.link < 0 && event.key.startsWith("Arrow")) go(0, 0);
      else act();
    });
    scroll.addEventListener("blur", hide);
    const at = (event) => {
      const box = svg.getBoundingClientRect();
      const scale = width / box.width;
      return find((event.clientX - box.left) * scale, (event.clientY - box.top) * scale);
    };
    svg.addEventListener("pointermove", (event) => {
      const found = at(event);
      if (!found) return hide();
      mark(found[0], found[1]);
      show(found[0], found[1], event.clientX, event.clientY);
    });
    svg.addEventListener("pointerleave", hide);
    svg.addEventListener("click", (event) => {
      const found = at(event);
      if (found) go(found[0], found[1]);
    });
  };

  // A table of scenarios: a search in its words, and a button for each verdict.
  const filter = (table) => {
    const rows = [...table.tBodies[0].rows];
    if (rows.length < 4) return;
    const tools = make("div", document.body, { class: "tools", role: "group", "aria-label": "Which scenarios are shown" });
    table.before(tools);
    const find = make("input", tools, { class: "find", type: "search", placeholder: "search", "aria-label": "Search in the scenarios" });
    const said = make("span", tools, { class: "note", role: "status" });
    const chosen = new Set();
    const apply = () => {
      const words = find.value.toLowerCase().split(/\s+/).filter(Boolean);
      let shown = 0;
      for (const row of rows) {
        const text = row.textContent.toLowerCase();
        const fits = words.every((word) => text.includes(word)) && (chosen.size === 0 || chosen.has(row.cells[0].textContent));
        row.hidden = !fits;
        shown += fits;
      }
      said.textContent = shown === rows.length ? "" : shown + " of " + rows.length + " shown";
    };
    find.addEventListener("input", apply);
    const verdicts = [...new Set(rows.map((row) => row.cells[0].textContent))];
    if (verdicts.length > 1) {
      for (const verdict of verdicts) {
        const element = make("button", tools, { type: "button", "aria-pressed": "false" }, verdict);
        element.addEventListener("click", () => {
          if (!chosen.delete(verdict)) chosen.add(verdict);
          element.setAttribute("aria-pressed", String(chosen.has(verdict)));
          apply();
        });
      }
    }
    tools.append(said);
  };
  for (const table of document.querySelectorAll("table.rows")) filter(table);

  // What is shown of a byte closes by Escape anywhere, by the wheel, and by pointing elsewhere.
  const close = () => tip.setAttribute("hidden", "");
  document.addEventListener("keydown", (event) => event.key === "Escape" && close());
  document.addEventListener("wheel", close, { passive: true });
  document.addEventListener("pointerdown", (event) => event.target.closest("svg") || close());

  // Curves: a cursor at the sample next to the pointer, moved by the arrow keys too, with its time and the value of each curve there.
  const curve = (root) => {
    const data = JSON.parse(root.querySelector("script").textContent);
    const svg = root.querySelector(".chart");
    // Where the panels stand in the window: the values on the axis are left of them.
    const panels_box = () => {
      const box = svg.getBoundingClientRect();
      const [left, right] = ["paddingLeft", "paddingRight"].map((own) => parseFloat(getComputedStyle(svg)[own]));
      return { left: box.left + left, width: box.width - left - right };
    };
    const times = [...new Set(data.curves.flatMap((own) => own.at))].sort((a, b) => a - b);
    if (times.length === 0) return;
    const line = make("path", svg, { class: "cursor", visibility: "hidden" });
    const said = make("p", root, { class: "said", role: "status" });
    let place = -1;
    const clock = (at) => (at / data.per).toFixed(data.decimals) + " " + data.unit;
    // The first place of a sorted list whose value is not below `at`.
    const lower = (list, at) => {
      let low = 0;
      for (let high = list.length; low < high; ) {
        const middle = (low + high) >> 1;
        if (list[middle] < at) low = middle + 1;
        else high = middle;
      }
      return low;
    };
    const nearest = (list, at) => {
      const next = lower(list, at);
      return next > 0 && (next === list.length || at - list[next - 1] < list[next] - at) ? next - 1 : next;
    };
    const words = (own, at) => {
      const next = lower(own.at, at);
      const found = own.held ? (own.at[next] === at ? next : next - 1) : nearest(own.at, at);
      if (found < 0 || found >= own.at.length || (!own.held && Math.abs(own.at[found] - at) > own.reach)) return own.name + ": no sample";
      const time = own.held || own.at[found] === at ? "" : " at " + clock(own.at[found]);
      return own.name + ": " + own.words[found] + (own.unit ? " " + own.unit : "") + time;
    };
    const go = (to, y) => {
      place = Math.max(0, Math.min(times.length - 1, to));
      const at = times[place];
      const box = panels_box();
      const x = ((at - data.from) / (data.to - data.from)) * box.width;
      line.setAttribute("d", data.panels.map(([top, height]) => "M" + x.toFixed(1) + " " + top + "v" + height).join(""));
      line.setAttribute("visibility", "visible");
      const text = clock(at) + "\n" + data.curves.map((own) => words(own, at)).join("\n");
      said.textContent = text.replaceAll("\n", "; ");
      // Keys leave the curves in sight: what is said stands below them.
      if (y === undefined) return close();
      tip.textContent = text;
      tip.removeAttribute("hidden");
      const own = tip.getBoundingClientRect();
      tip.style.left = Math.max(4, Math.min(box.left + x + 14, innerWidth - own.width - 8)) + "px";
      tip.style.top = Math.min(y + 18, innerHeight - own.height - 4) + "px";
    };
    const hide = () => {
      line.setAttribute("visibility", "hidden");
      close();
    };
    const point = (event) => {
      const box = panels_box();
      const at = data.from + ((event.clientX - box.left) / box.width) * (data.to - data.from);
      go(nearest(times, at), event.clientY);
    };
    svg.addEventListener("pointermove", point);
    svg.addEventListener("pointerdown", point);
    svg.addEventListener("pointerleave", hide);
    const keys = { ArrowLeft: -1, ArrowRight: 1, PageUp: -20, PageDown: 20, Home: -Infinity, End: Infinity };
    root.addEventListener("keydown", (event) => {
      if (event.ctrlKey || event.altKey || event.metaKey) return;
      if (event.key === "Escape") return hide();
      if (!(event.key in keys)) return;
      event.preventDefault();
      go(place + keys[event.key]);
    });
    root.addEventListener("blur", hide);
  };
  for (const root of document.querySelectorAll(".plot")) curve(root);

  // A page of many scenarios opens at once: a diagram is made ready when it comes near.
  const watcher = new IntersectionObserver((seen) => {
    for (const { isIntersecting, target } of seen) {
      if (!isIntersecting) continue;
      watcher.unobserve(target);
      ring(target);
    }
  }, { rootMargin: "600px" });
  for (const root of document.querySelectorAll(".ring")) watcher.observe(root);
})();
