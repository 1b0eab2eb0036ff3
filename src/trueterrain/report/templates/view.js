// Surfaces to turn and zoom. Where they cannot be drawn, the picture from above stays.
"use strict";
(() => {
  const canDraw = () => {
    try {
      return Boolean(document.createElement("canvas").getContext("webgl"));
    } catch {
      return false;
    }
  };
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  const colours = () => {
    const ink = dark.matches ? "#d8dde1" : "#333a40";
    const grid = dark.matches ? "#4a5258" : "#d0d5d9";
    const changes = {
      "font.color": ink, "modebar.color": grid, "modebar.activecolor": ink,
      "modebar.bgcolor": "rgba(0,0,0,0)",
    };
    for (const axis of ["xaxis", "yaxis", "zaxis"]) {
      changes[`scene.${axis}.gridcolor`] = grid;
      changes[`scene.${axis}.zerolinecolor`] = grid;
      changes[`scene.${axis}.linecolor`] = ink;
    }
    return changes;
  };

  // each row of nodes is straight: its ends tell where the others are
  const nodes = ({ fraction, ...ends }) => {
    const rows = (first, last) =>
      first.map((begin, row) => fraction.map((part) => begin + part * (last[row] - begin)));
    return { x: rows(ends.x_first, ends.x_last), y: rows(ends.y_first, ends.y_last) };
  };

  const show = (view) => {
    const scene = view.querySelector(".scene");
    const { figure, places } = JSON.parse(view.querySelector(".figure").textContent);
    Object.assign(figure.data[0], nodes(places));
    const first = Number(view.dataset.exaggeration);
    const height = figure.layout.scene.aspectratio.z / first; // of heights as they are
    const camera = structuredClone(figure.layout.scene.camera);
    const label = (factor) => `Vertical exaggeration ${factor} ×`;
    // inside the drawing as well, so that an image saved from it says so too
    figure.layout.annotations = [{
      text: label(first), xref: "paper", yref: "paper", x: 0, y: 0,
      xanchor: "left", yanchor: "bottom", showarrow: false,
    }];
    figure.layout.font = { family: getComputedStyle(document.body).fontFamily, size: 12 };
    view.querySelector(".live").hidden = false;
    view.classList.add("turning");

    const exaggerate = (factor) => {
      Plotly.relayout(scene, {
        "scene.aspectratio.z": height * factor,
        "annotations[0].text": label(factor),
      });
      view.querySelector(".factor").textContent = label(factor);
      for (const button of view.querySelectorAll("[data-factor]")) {
        button.setAttribute("aria-pressed", String(Number(button.dataset.factor) === factor));
      }
    };
    const look = (change) => {
      const now = scene.layout.scene.camera;
      Plotly.relayout(scene, { "scene.camera": { ...now, ...change(now) } });
    };
    const turned = (by) => ({ eye: e, center: c }) => {
      const angle = (by * Math.PI) / 180;
      const [x, y] = [e.x - c.x, e.y - c.y];
      return { eye: {
        x: c.x + x * Math.cos(angle) - y * Math.sin(angle),
        y: c.y + x * Math.sin(angle) + y * Math.cos(angle),
        z: e.z,
      } };
    };
    const zoomed = (by) => ({ eye: e, center: c }) => ({ eye: {
      x: c.x + by * (e.x - c.x), y: c.y + by * (e.y - c.y), z: c.z + by * (e.z - c.z),
    } });
    const above = () => {
      const { x, y, z } = camera.eye;
      const height = Math.hypot(x, y, z);
      // not quite from above, where turning would lose its way
      return { ...camera, eye: { x: 0.01 * x, y: 0.01 * y, z: height } };
    };

    view.querySelector(".tools").addEventListener("click", ({ target }) => {
      const asked = target.dataset;
      if ("factor" in asked) exaggerate(Number(asked.factor));
      if ("turn" in asked) look(turned(Number(asked.turn)));
      if ("zoom" in asked) look(zoomed(Number(asked.zoom)));
      if ("above" in asked) look(above);
      if ("reset" in asked) {
        look(() => camera);
        exaggerate(first);
      }
    });
    const settings = {
      displaylogo: false, responsive: true,
      showSendToCloud: false, plotlyServerURL: "", // what is in the page stays there
    };
    Plotly.newPlot(scene, figure.data, figure.layout, settings)
      .then(() => Plotly.relayout(scene, colours()));
    dark.addEventListener("change", () => Plotly.relayout(scene, colours()));
  };

  if (canDraw()) document.querySelectorAll(".view").forEach(show);
})();
