// Numbers and elements of the page.

const byId = (id) => document.getElementById(id);

function say(words) {
  byId("view-message").textContent = words;
}

/** A number with three digits, in the way of the tables of the page. */
function text(value, digits = 3) {
  if (value === null || !Number.isFinite(value)) return "–";
  const size = Math.abs(value);
  const plain = value === 0 || (size >= 1e-3 && size < 1e5);
  return (plain ? String(Number(value.toPrecision(digits))) : value.toExponential(digits - 1))
    .replace(/-/g, "−")
    .replace("e+", "e");
}

const quantity = (value, column) => `${text(value / column.factor)} ${column.unit}`.trim();

/** [factor, unit] of a length. */
function lengthUnit(length) {
  if (length >= 1) return [1, "m"];
  return length >= 1e-3 ? [1e-3, "mm"] : [1e-6, "µm"];
}

/** The largest of 1, 2, 5 times a power of ten that is not above a length. */
function roundLength(length) {
  const power = 10 ** Math.floor(Math.log10(length));
  return [5, 2, 1].find((step) => step * power <= length) * power;
}

function svg(name, attributes) {
  const element = document.createElementNS(byId("view-axes").namespaceURI, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  return element;
}

/** A table with a caption, column heads and rows of texts; all but the first are flush right. */
function table(caption, heads, rows) {
  const element = document.createElement("table");
  element.createCaption().textContent = caption;
  if (heads.some((head) => head)) {
    const row = element.createTHead().insertRow();
    for (const head of heads) {
      const cell = document.createElement("th");
      cell.scope = "col";
      cell.textContent = head;
      row.append(cell);
    }
  }
  const body = element.createTBody();
  for (const texts of rows) {
    const row = body.insertRow();
    texts.forEach((content, i) => {
      const cell = row.insertCell();
      cell.textContent = content;
      if (i > 0) cell.className = "number";
    });
  }
  return element;
}
