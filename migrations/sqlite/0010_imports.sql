-- Maps of other programs that operators took as a level's prior: entries of its log, with revisions
-- from the same row. Immutable. The latest one is the prior; one without a report took it away.
create table imports (
    site     text   not null,
    level    text   not null,
    revision bigint not null, -- place in the level's log; no contribution and no act has it
    import   text   not null, -- UUID, made by the server
    digest   text   not null, -- SHA-256 of the description, the image and the trust, lower-case hexadecimal; of a removal, empty
    author   text   not null, -- public id of the token
    at_us    bigint not null, -- microseconds since 1970, the server's clock
    report   text,            -- JSON: what was found in the map; null for a removal
    constraint imports_pk primary key (site, level, revision),
    constraint imports_id_unique unique (site, level, import)
);

-- What an import says about the level's cells.
create table prior_tiles (
    site     text   not null,
    level    text   not null,
    revision bigint not null, -- of the import
    x        bigint not null, -- tiles to the right of the level's origin
    y        bigint not null, -- tiles up from the level's origin
    content  blob   not null, -- as in tiles: zstd of 64 x 64 little-endian 32-bit integers, 0.01 nat
    constraint prior_tiles_pk primary key (site, level, revision, x, y)
);
