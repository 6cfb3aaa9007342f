//! Borders of occupied cells, as rings of cells' corners, and the straight lines that they stand for.

use mapfold_map::geometry::Point;

/// Which cells are occupied, the lowest row first.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Mask {
    pub(super) columns: usize,
    pub(super) rows: usize,
    pub(super) occupied: Vec<bool>,
}

impl Mask {
    pub(super) fn count(&self) -> u64 {
        self.occupied.iter().filter(|occupied| **occupied).count() as u64
    }

    fn at(&self, column: i64, row: i64) -> bool {
        let inside = |value: i64, count: usize| (0..count as i64).contains(&value);
        inside(column, self.columns)
            && inside(row, self.rows)
            && self.occupied[row as usize * self.columns + column as usize]
    }

    /// The cells around one, that one included.
    fn around(&self, cell: usize) -> impl Iterator<Item = usize> {
        let (column, row) = (cell % self.columns, cell / self.columns);
        let columns = column.saturating_sub(1)..(column + 2).min(self.columns);
        let rows = row.saturating_sub(1)..(row + 2).min(self.rows);
        let width = self.columns;
        rows.flat_map(move |row| columns.clone().map(move |column| row * width + column))
    }

    /// Whether a cell or one around it is occupied.
    pub(super) fn has_neighbour(&self, cell: usize) -> bool {
        self.around(cell).any(|cell| self.occupied[cell])
    }

    /// Cells that hang together, corners counting, in the order of their first cells; each sorted.
    pub(super) fn components(&self) -> Vec<Vec<usize>> {
        let mut left = self.occupied.clone();
        let mut all = Vec::new();
        let mut open = Vec::new();
        for first in 0..left.len() {
            if !std::mem::take(&mut left[first]) {
                continue;
            }
            let mut component = Vec::new();
            open.push(first);
            while let Some(cell) = open.pop() {
                component.push(cell);
                for next in self.around(cell) {
                    if std::mem::take(&mut left[next]) {
                        open.push(next);
                    }
                }
            }
            component.sort_unstable();
            all.push(component);
        }
        all
    }

    /// Takes away what has fewer cells than `least`; tells how many such things there were.
    pub(super) fn without_specks(&mut self, least: usize) -> usize {
        let specks: Vec<Vec<usize>> =
            self.components().into_iter().filter(|cells| cells.len() < least).collect();
        for cell in specks.iter().flatten() {
            self.occupied[*cell] = false;
        }
        specks.len()
    }

    /// Some cells by themselves, and where the lower left corner of what holds them is.
    pub(super) fn cut_out(&self, cells: &[usize]) -> (Self, Point) {
        let columns = || cells.iter().map(|cell| cell % self.columns);
        let rows = || cells.iter().map(|cell| cell / self.columns);
        let (left, low) = (columns().min().unwrap_or(0), rows().min().unwrap_or(0));
        let (right, high) = (columns().max().unwrap_or(0) + 1, rows().max().unwrap_or(0) + 1);
        let mut local = Self { columns: right - left, rows: high - low, occupied: Vec::new() };
        local.occupied.resize(local.columns * local.rows, false);
        for cell in cells {
            let (column, row) = (cell % self.columns - left, cell / self.columns - low);
            local.occupied[row * local.columns + column] = true;
        }
        (local, Point::new(left as f64, low as f64))
    }

    /// Some cells as rectangles: runs of a row, joined with equal runs of the rows above. `[left, low, right, high]`.
    pub(super) fn rectangles(&self, cells: &[usize]) -> Vec<[usize; 4]> {
        let mut done: Vec<[usize; 4]> = Vec::new();
        let mut growing: Vec<[usize; 4]> = Vec::new();
        let mut runs: Vec<[usize; 3]> = Vec::new();
        for cell in cells {
            let (column, row) = (cell % self.columns, cell / self.columns);
            match runs.last_mut() {
                Some([at, _, right]) if *at == row && *right == column => *right += 1,
                _ => runs.push([row, column, column + 1]),
            }
        }
        for row in runs.chunk_by(|a, b| a[0] == b[0]) {
            let mut next = Vec::with_capacity(row.len());
            for [at, left, right] in row {
                let known = growing.iter().find(|r| r[0] == *left && r[2] == *right && r[3] == *at);
                let low = known.map_or(*at, |known| known[1]);
                next.push([*left, low, *right, at + 1]);
            }
            let goes_on = |old: &[usize; 4]| next.iter().any(|new| new[..3] == old[..3]);
            done.extend(growing.iter().filter(|old| !goes_on(old)));
            growing = next;
        }
        done.extend(growing);
        done
    }
}

/// Directions along the sides of cells: right, up, left, down.
const STEPS: [[i64; 2]; 4] = [[1, 0], [0, 1], [-1, 0], [0, -1]];

/// The borders of what is occupied, by the corners of cells: with what is occupied on the left, so outer ones
/// counter-clockwise and holes clockwise; outer ones before the holes in them. Cells that touch at a corner only are apart.
pub(super) fn rings(mask: &Mask) -> Vec<Vec<[i64; 2]>> {
    // Cells that touch the side after a corner, by direction: the one on its left, and the one on its right.
    let sides = |[x, y]: [i64; 2], direction: usize| match direction {
        0 => ([x, y], [x, y - 1]),
        1 => ([x - 1, y], [x, y]),
        2 => ([x - 1, y - 1], [x - 1, y]),
        _ => ([x, y - 1], [x - 1, y - 1]),
    };
    let is_border = |at: [i64; 2], direction: usize| {
        let (left, right) = sides(at, direction);
        mask.at(left[0], left[1]) && !mask.at(right[0], right[1])
    };
    let width = mask.columns + 1;
    let mut seen = vec![0_u8; width * (mask.rows + 1)];
    let mut rings = Vec::new();
    for row in 0..=mask.rows {
        for column in 0..width {
            for direction in [0, 2] {
                let start = [column as i64, row as i64];
                if seen[row * width + column] & 1 << direction != 0 || !is_border(start, direction)
                {
                    continue;
                }
                let (mut at, mut heading) = (start, direction);
                let mut ring = Vec::new();
                loop {
                    let mark = &mut seen[at[1] as usize * width + at[0] as usize];
                    if *mark & 1 << heading != 0 {
                        break;
                    }
                    *mark |= 1 << heading;
                    ring.push(at);
                    at = [at[0] + STEPS[heading][0], at[1] + STEPS[heading][1]];
                    // To the left first: cells that touch at a corner stay apart.
                    let turns = [(heading + 1) % 4, heading, (heading + 3) % 4];
                    heading =
                        turns.into_iter().find(|turn| is_border(at, *turn)).unwrap_or(heading);
                }
                rings.push(ring);
            }
        }
    }
    rings
}

/// The corners of a ring once its stretches are straight: nothing is farther from them than `tolerance` cells. Stretches are
/// fitted to the middles of the sides of cells, which takes out their steps; corners are where neighbours meet.
pub(super) fn straight(ring: &[[i64; 2]], tolerance: f64) -> Vec<Point> {
    let points: Vec<Point> = ring.iter().map(|[x, y]| Point::new(*x as f64, *y as f64)).collect();
    let count = points.len();
    let middles: Vec<Point> =
        (0..count).map(|k| (points[k] + points[(k + 1) % count]) / 2.0).collect();
    // From the point farthest from the first one, which is a corner in any case.
    let far = |from: usize| {
        let distance = |k: &usize| (middles[*k] - middles[from]).norm_squared();
        (0..count).max_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or(0)
    };
    let first = far(0);
    let other = far(first);
    let mut kept = vec![false; count];
    (kept[first], kept[other]) = (true, true);
    let mut open = vec![(first, other), (other, first + count)];
    while let Some((from, to)) = open.pop() {
        let to = if to <= from { to + count } else { to };
        let (p, q) = (middles[from % count], middles[to % count]);
        let step = q - p;
        let length = step.norm().max(1e-9);
        let off = |k: &usize| step.perp(&(middles[k % count] - p)).abs() / length;
        let Some(worst) = (from + 1..to).max_by(|a, b| off(a).total_cmp(&off(b))) else { continue };
        if off(&worst) > tolerance {
            kept[worst % count] = true;
            open.extend([(from, worst), (worst, to)]);
        }
    }
    let corners: Vec<usize> = (0..count).filter(|k| kept[*k]).collect();
    let lines: Vec<(Point, Point)> = corners
        .iter()
        .enumerate()
        .map(|(k, from)| {
            let to = corners[(k + 1) % corners.len()];
            let to = if to <= *from { to + count } else { to };
            fitted((*from..=to).map(|k| middles[k % count]))
        })
        .collect();
    let meet = |k: usize| {
        let before = lines[(k + corners.len() - 1) % corners.len()];
        let after = lines[k];
        let corner = middles[corners[k]];
        let sine = before.1.perp(&after.1);
        let t = (after.0 - before.0).perp(&after.1) / sine;
        let met = before.0 + before.1 * t;
        if sine.abs() > 0.3 && (met - corner).norm() <= 2.0 * tolerance { met } else { corner }
    };
    (0..corners.len()).map(meet).collect()
}

/// The line that points lie along best: a point and a direction. By the larger axis of their spread.
fn fitted(points: impl Iterator<Item = Point> + Clone) -> (Point, Point) {
    let count = points.clone().count().max(1) as f64;
    let middle = points.clone().fold(Point::zeros(), |sum, p| sum + p) / count;
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for p in points {
        let d = p - middle;
        xx += d.x * d.x;
        xy += d.x * d.y;
        yy += d.y * d.y;
    }
    let angle = f64::atan2(2.0 * xy, xx - yy) / 2.0;
    (middle, Point::new(angle.cos(), angle.sin()))
}
