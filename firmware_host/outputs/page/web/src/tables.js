// Tables, folded where they are long.

function element(tag, text, className) {
  const made = document.createElement(tag);
  if (text != null) made.textContent = text;
  if (className) made.className = className;
  return made;
}

export function tableElement(table) {
  const details = element('details');
  details.open = !table.folded;
  details.dataset.table = table.id;
  details.append(element('summary', `${table.title}${table.folded ? ` (${table.rows.length})` : ''}`));
  const body = element('table');
  const head = element('tr');
  for (const column of table.columns) head.append(element('th', column));
  body.append(head);
  for (const row of table.rows) {
    const line = element('tr');
    for (const cell of row) {
      const missed = cell.endsWith(' missed');
      line.append(element('td', cell, missed ? 'missed' : ''));
    }
    body.append(line);
  }
  details.append(body);
  return details;
}

export function eventsTable(run) {
  return tableElement({
    id: 'events', title: 'Events', folded: true, columns: ['t [s]', 'event', 'what'],
    rows: run.events.map((e) => [e.t.toFixed(3), e.name, e.text]),
  });
}

export { element };
