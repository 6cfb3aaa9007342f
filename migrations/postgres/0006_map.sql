-- The folded map, written behind: for each thing that ever was in it, what it is and since which
-- revision. A thing that is no more keeps its row without content, so that readers learn of it.
create table segments (
    site     text   not null,
    level    text   not null,
    feature  text   not null, -- <contribution>-<index> of the observation that founded it
    revision bigint not null, -- of its last change
    content  bytea,           -- CBOR as published; null if it is no more
    constraint segments_pk primary key (site, level, feature)
);

create table clusters (
    site     text   not null,
    level    text   not null,
    feature  text   not null, -- <contribution>-<index> of the observation that founded it
    revision bigint not null, -- of its last change
    content  bytea,           -- CBOR as published; null if it is no more
    constraint clusters_pk primary key (site, level, feature)
);

create table tiles (
    site     text   not null,
    level    text   not null,
    sensor   text   not null, -- scanner or sonar
    x        bigint not null, -- tiles to the right of the level's origin
    y        bigint not null, -- tiles up from the level's origin
    revision bigint not null, -- of its last change
    content  bytea,           -- zstd of 64 x 64 little-endian 32-bit sums, 0.01 nat, row by row from below; null if it is no more
    constraint tiles_pk primary key (site, level, sensor, x, y),
    constraint tiles_sensor_known check (sensor in ('scanner', 'sonar'))
);
