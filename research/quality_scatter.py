#!/usr/bin/env python3
"""Expected quality against trained PSNR, from docs/results/quality-layouts.csv: a table on standard output and an SVG scatter plot.

usage: quality_scatter.py LAYOUTS.csv OUT.svg
"""
import csv
import sys
from collections import defaultdict
from statistics import mean, median

COLOURS = {10: "#d08020", 20: "#2060c0", 50: "#208060", 100: "#a03060"}


def pearson(x, y):
    a, b = mean(x), mean(y)
    sxy = sum((u - a) * (v - b) for u, v in zip(x, y))
    return sxy / (sum((u - a) ** 2 for u in x) * sum((v - b) ** 2 for v in y)) ** 0.5


def main():
    groups = defaultdict(list)
    with open(sys.argv[1]) as file:
        for row in csv.DictReader(file):
            numbers = tuple(float(row[name]) for name in ("expected_db", "score_db", "trained_psnr"))
            groups[row["scene"], row.get("situation", "free"), int(row["views"])].append((*numbers, row["held_out"] == "1"))
    print(
        "| views | scenes | layouts | Pearson, mean (held out) | least | by `score` | pairs expected within 0.05 dB: "
        "trained, median dB | within 0.2 dB |"
    )
    print("|---|---|---|---|---|---|---|---|")
    for views in sorted({views for *_, views in groups}):
        runs = [points for (*_, budget), points in groups.items() if budget == views]
        found = [pearson([p[0] for p in points], [p[2] for p in points]) for points in runs]
        held = [value for value, points in zip(found, runs) if points[0][3]]
        scored = [pearson([p[1] for p in points], [p[2] for p in points]) for points in runs]
        alike = [abs(a[2] - b[2]) for points in runs for i, a in enumerate(points) for b in points[:i] if abs(a[0] - b[0]) < 0.05]
        share = 100 * sum(d < 0.2 for d in alike) / len(alike)
        layouts = sum(map(len, runs))
        print(
            f"| {views} | {len(runs)} | {layouts} | {mean(found):.3f} ({mean(held):.3f}) | {min(found):.2f} | {mean(scored):.3f} "
            f"| {median(alike):.2f} | {share:.0f}% |"
        )
    marks = []
    for (*_, views), points in groups.items():
        x0, y0 = median(p[0] for p in points), median(p[2] for p in points)
        for x, _, y, _ in points:
            u, v = 400 + 60 * (x - x0), 300 - 60 * (y - y0)
            if 60 <= u <= 740 and 40 <= v <= 560:
                marks.append(f'<circle cx="{u:.1f}" cy="{v:.1f}" r="3" fill="{COLOURS.get(views, "#666")}" fill-opacity="0.6"/>')
    ticks = "".join(
        f'<text x="{400 + 60 * t}" y="580" text-anchor="middle">{t:+d}</text><text x="50" y="{305 - 60 * t}" text-anchor="end">{t:+d}</text>'
        for t in range(-4, 5, 2)
    )
    legend = "".join(
        f'<circle cx="90" cy="{60 + 20 * i}" r="4" fill="{colour}"/><text x="102" y="{65 + 20 * i}">{views} views</text>'
        for i, (views, colour) in enumerate(COLOURS.items())
    )
    with open(sys.argv[2], "w") as file:
        file.write(
            '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 800 620" width="800" height="620" font-family="sans-serif" font-size="14">'
            '<rect width="800" height="620" fill="white"/><rect x="60" y="40" width="680" height="520" fill="none" stroke="#444"/>'
            f'<line x1="140" y1="560" x2="660" y2="40" stroke="#bbb"/>{"".join(marks)}{ticks}{legend}'
            '<text x="400" y="25" text-anchor="middle" font-size="17">Layouts of cameras, against the median of their scene and budget</text>'
            '<text x="400" y="606" text-anchor="middle">expected, dB</text>'
            '<text x="18" y="300" text-anchor="middle" transform="rotate(-90 18 300)">trained PSNR, dB</text></svg>\n'
        )


if __name__ == "__main__":
    main()
