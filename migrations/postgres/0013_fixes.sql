-- What a robot last knew of its place, as it reports: also while it is not sure of it and contributes nothing.
alter table robots add column fix text; -- JSON; null before the first report
