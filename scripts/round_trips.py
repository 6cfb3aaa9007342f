#!/usr/bin/env python3
"""Takes real buildings into a server, writes them in every format, and takes these in again: scripts/round_trips.py SERVER [DATA]

SERVER is the program mapfold-server, DATA the folder of real plans (../shared/data/plans if absent). Prints a table in Markdown: what came in,
the landmarks at 0.3 m, and of each format whether the plan at 0.3 m of what comes back is the same, byte for byte. A plan as
GeoJSON cannot tell which walls an outline is of: what comes back of it is held against its landmarks and the area of
its outlines. Ends with 1 if a plan is another one. Knows only what any client of the HTTP API knows.
"""

import json
import os
import pathlib
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.parse
import urllib.request

TOKEN = "mfa_" + "0" * 43
TYPES = {"jsonfg": "application/fg+json", "dxf": "image/vnd.dxf", "glb": "model/gltf-binary"}
BUILDINGS = [
    ("rmf/office.building.yaml", "application/yaml", {}),
    ("rmf/hotel.building.yaml", "application/yaml", {"building_level": "L1"}),
    ("rmf/hotel.building.yaml", "application/yaml", {"building_level": "L2"}),
    ("rmf/hotel.building.yaml", "application/yaml", {"building_level": "L3"}),
    ("rmf/triple_H.building.yaml", "application/yaml", {}),
    ("rmf/battle_royale.building.yaml", "application/yaml", {}),
    ("dxf/floorplan.dxf", TYPES["dxf"], {"unit_m": "0.0254"}),
]


class Api:
    def __init__(self, base, token):
        self.base, self.token = base, token

    def ask(self, method, path, body=None, media_type="application/json", accept=None):
        headers = {"Authorization": f"Bearer {self.token}"}
        if body is not None:
            headers["Content-Type"] = media_type
        if accept:
            headers["Accept"] = accept
        url = f"{self.base}/api/v1{path}"
        request = urllib.request.Request(url, data=body, headers=headers, method=method)
        with urllib.request.urlopen(request, timeout=600) as answer:
            return answer.read()

    def level(self, name):
        self.ask("POST", "/sites", json.dumps({"site": name}).encode())
        self.ask("POST", f"/sites/{name}/levels", json.dumps({"level": "l"}).encode())
        return f"/sites/{name}/levels/l"


def main(program, data):
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "MAPFOLD_ADMIN_TOKEN": TOKEN}
        command = [program, "--listen", "127.0.0.1:7391", "--data-dir", folder]
        server = subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            api = Api("http://127.0.0.1:7391", TOKEN)
            for _ in range(200):
                try:
                    api.ask("GET", "/sites")
                    break
                except OSError:
                    time.sleep(0.1)
            sys.exit(table(api, data))
        finally:
            server.terminate()
            server.wait()


def compared(before, after):
    """Whether two plans have the same landmarks to 2 mm and outlines of the same area to a thousandth, and words for it."""
    told = [[(f["properties"]["shape"], *f["geometry"]["coordinates"][:2]) for f in plan if f["properties"]["kind"] == "landmark"] for plan in (before, after)]
    left = list(told[1])
    found = 0
    for shape, x, y in told[0]:
        near = [mark for mark in left if mark[0] == shape and abs(mark[1] - x) <= 0.002 and abs(mark[2] - y) <= 0.002]
        if near:
            left.remove(near[0])
            found += 1
    areas = [sum(area(f["geometry"]) for f in plan if f["properties"]["shape"] in ("room", "obstacle")) for plan in (before, after)]
    is_same = found == len(told[0]) and not left and abs(areas[0] - areas[1]) <= 0.001 * areas[0]
    words = f"{found} of {len(told[0])} landmarks" + (f", {len(left)} others" if left else "")
    return is_same, words + f"; {areas[1]:.2f} of {areas[0]:.2f} m2"


def area(geometry):
    """Area of a Polygon, or of several: rings wind about what is inside, holes the other way."""
    polygons = {"Polygon": [geometry["coordinates"]], "MultiPolygon": geometry["coordinates"]}.get(geometry["type"], [])
    total = 0.0
    for polygon in polygons:
        for number, ring in enumerate(polygon):
            twice = abs(sum(a[0] * b[1] - b[0] * a[1] for a, b in zip(ring, ring[1:])))
            total += twice / 2 * (1 if number == 0 else -1)
    return total


def table(api, data):
    print("| building | walls, doorways, others | instances | outlines | landmarks | seconds | " + " | ".join(TYPES) + " | geojson |")
    print("| --- " * (7 + len(TYPES)) + "|")
    wrong = 0
    buildings = BUILDINGS + [(f, TYPES["glb"], {}) for f in os.environ.get("GLB", "").split()]
    for number, (file, media_type, query) in enumerate(buildings):
        level = api.level(f"b{number}")
        body = (data / file).read_bytes()
        began = time.monotonic()
        told = json.loads(api.ask("POST", f"{level}/imports?{urllib.parse.urlencode(query)}", body, media_type))
        seconds = time.monotonic() - began
        model = json.loads(api.ask("GET", f"{level}/exports/jsonfg"))
        kinds = [feature["properties"]["kind"] for feature in model["features"]]
        instances = sum("prototype" in feature["properties"] for feature in model["features"])
        plan = api.ask("GET", f"{level}/exports/geojson?of=gdb")
        shown = json.loads(plan)["features"]
        landmarks = [f["properties"]["shape"] for f in shown if f["properties"]["kind"] == "landmark"]
        counted = ", ".join(f"{landmarks.count(w)} {w.replace('_', ' ')}" for w in sorted(set(landmarks)))
        outlines = sum(f["properties"]["shape"] in ("room", "obstacle") for f in shown)
        cells = []
        for format, sent_as in TYPES.items():
            there = api.level(f"b{number}-{format}")
            api.ask("POST", f"{there}/imports", api.ask("GET", f"{level}/exports/{format}"), sent_as)
            same = api.ask("GET", f"{there}/exports/geojson?of=gdb") == plan
            objects = len(json.loads(api.ask("GET", f"{there}/exports/jsonfg"))["features"])
            wrong += not same
            cells.append("the same" if same else f"another plan, {objects} objects")
        there = api.level(f"b{number}-geojson")
        api.ask("POST", f"{there}/imports", plan, "application/geo+json")
        back = json.loads(api.ask("GET", f"{there}/exports/geojson?of=gdb"))["features"]
        is_same, words = compared(shown, back)
        wrong += not is_same
        cells.append(words)
        name = pathlib.Path(file).name + "".join(f" {value}" for value in query.values())
        others = len(kinds) - kinds.count("wall") - kinds.count("doorway")
        counts = f"{kinds.count('wall')}, {kinds.count('doorway')}, {others}"
        print(f"| {name} | {counts} | {instances} | {outlines} | {counted} | {seconds:.2f} | " + " | ".join(cells) + " |", flush=True)
        for left in told["report"].get("left_out", []):
            print(f"  left out: {left['count']} {left['what']}: {left['why']}", file=sys.stderr)
        for warning in told["report"]["warnings"]:
            print(f"  {warning}", file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    main(sys.argv[1], pathlib.Path(sys.argv[2] if len(sys.argv) > 2 else "../shared/data/plans"))
