-- What operators did to a level's log: entries of it like contributions, with revisions from the
-- same row. Immutable but for `undone_revision`. A list of revisions is written as unsigned LEB128
-- numbers: the first one, then the difference from each to the next.
create table acts (
    site            text   not null,
    level           text   not null,
    revision        bigint not null, -- place in the level's log; no contribution has it
    act             text   not null, -- UUID, made by whoever asked, or by the server
    kind            text   not null, -- revert, or restore: the undoing of a revert
    digest          text   not null, -- SHA-256 of what was asked for, lower-case hexadecimal
    author          text   not null, -- public id of the token
    reason          text   not null, -- in the author's words
    at_us           bigint not null, -- microseconds since 1970, the server's clock
    robot           text,            -- of a revert by robot and span; null if contributions were named
    from_us         bigint,          -- first instant of that span, the robot's clock; null if it has none
    to_us           bigint,          -- end of that span, not in it; null if it has none
    robots          text   not null, -- JSON: whose the covered contributions are
    covered_count   bigint not null,
    moved_count     bigint not null,
    covered         blob   not null, -- revisions of the contributions that a revert keeps out while it stands
    moved           blob   not null, -- revisions of the contributions that it took out, or put back
    undone_revision bigint,          -- of the restore that undid this revert; null while it stands
    constraint acts_pk primary key (site, level, revision),
    constraint acts_id_unique unique (site, level, act),
    constraint acts_kind_known check (kind in ('revert', 'restore'))
);

alter table robots add column reverted bigint not null default 0; -- of `contributions`
