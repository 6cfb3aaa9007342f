-- Evidence for each stretch of time, from which tiles are read. What a tile reads as is not kept: its
-- slices tell. Sums of all times cannot be taken apart again, so maps are folded from their logs
-- once more. (Nothing has been released that reads the columns that go.)
create table slices (
    site     text   not null,
    level    text   not null,
    sensor   text   not null, -- scanner or sonar
    x        bigint not null, -- tiles to the right of the level's origin
    y        bigint not null, -- tiles up from the level's origin
    slice    bigint not null, -- stretch of time, counted from 1970 in lengths of the level's slices
    revision bigint not null, -- of its last change
    content  blob,            -- zstd of 64 x 64 little-endian 32-bit sums, 0.01 nat, row by row from below; null if there are no more
    constraint slices_pk primary key (site, level, sensor, x, y, slice),
    constraint slices_sensor_known check (sensor in ('scanner', 'sonar'))
);
drop table tiles;
create table tiles (
    site     text   not null,
    level    text   not null,
    sensor   text   not null, -- scanner or sonar
    x        bigint not null, -- tiles to the right of the level's origin
    y        bigint not null, -- tiles up from the level's origin
    revision bigint not null, -- of the last change of what it reads as
    is_gone  bigint not null, -- 1 if it is no more, else 0
    constraint tiles_pk primary key (site, level, sensor, x, y),
    constraint tiles_sensor_known check (sensor in ('scanner', 'sonar')),
    constraint tiles_is_gone_flag check (is_gone in (0, 1))
);
-- Length of a level's slices, seconds, never changed.
alter table levels add column slice_s bigint not null default 86400;
delete from segments;
delete from clusters;
delete from chains;
update levels set folded_revision = 0;
