// What keys do. Those that the focused control handles itself are not intercepted.

function press(player, event) {
  const { target } = event;
  if (event.ctrlKey || event.altKey || event.metaKey || find("keys").open) return;
  if (event.key !== "Escape") {
    if (target.tagName === "SELECT" || target.type === "number") return;
    if (target.type === "range" && /^(Arrow|Home|End|Page)/.test(event.key)) return;
    if (event.key === " " && (target.tagName === "BUTTON" || target.type === "checkbox")) return;
  }
  const check = (id) => !find(id).closest("[hidden]") && find(id).click();
  const step = event.shiftKey ? 10 : 1;
  const { colors, inspector, view } = player;
  const actions = {
    " ": () => player.setPlaying(!player.playing),
    ArrowLeft: () => player.goto(Math.ceil(player.at) - step),
    ArrowRight: () => player.goto(Math.floor(player.at) + step),
    Home: () => player.goto(0),
    End: () => player.goto(player.last),
    "-": () => player.setSpeed(-0.5),
    "+": () => player.setSpeed(0.5),
    "=": () => player.setSpeed(0.5),
    l: () => player.nextScale(),
    c: () => colors.next(),
    x: () => check("fixed"),
    o: () => colors.setOpacity(Number(find("opacity").value) - 0.1),
    O: () => colors.setOpacity(Number(find("opacity").value) + 0.1),
    i: () => inspector.open(),
    Escape: () => inspector.choose(null),
    a: () => view.turn(-1, 0),
    d: () => view.turn(1, 0),
    w: () => view.turn(0, 1),
    s: () => view.turn(0, -1),
    q: () => view.zoom(1 / 1.1),
    e: () => view.zoom(1.1),
    r: () => view.look(),
    b: () => check("box"),
    f: () => check("flash"),
    g: () => check("show-curves"),
    t: () => find("theme").click(),
    "?": () => find("keys").showModal(),
  };
  if (!actions[event.key]) return;
  event.preventDefault();
  actions[event.key]();
}
