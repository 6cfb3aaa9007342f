-- A robot's own frame that a contribution's pose and evidence are in; null if it is the level's.
alter table contributions add column frame text;
create index contributions_by_frame on contributions (site, level, frame, revision) where frame is not null;

-- Where robots' own frames lie: entries of a level's log like acts, with revisions from the same row.
-- Immutable but for `withdrawn_revision`. Lists of revisions as in acts.
create table alignments (
    site               text             not null,
    level              text             not null,
    revision           bigint           not null, -- place in the level's log; no other entry has it
    kind               text             not null, -- align, or withdraw: the undoing of all that stand for the frame
    frame              text             not null, -- UUID of the robot's frame
    x_m                double precision not null, -- where its origin lies, metres, level frame
    y_m                double precision not null,
    heading_rad        double precision not null, -- radians, counter-clockwise from x
    covariance         text             not null, -- JSON: 3 x 3, of (x, y, heading)
    author             text             not null, -- public id of the token; 'rule' for the server itself
    at_us              bigint           not null, -- microseconds since 1970, the server's clock
    comment            text             not null, -- in the author's words
    moved_count        bigint           not null,
    moved              blob             not null, -- revisions of the contributions that it put into the map, or took out
    withdrawn_revision bigint,                    -- of the withdrawal; null while it stands, and for withdrawals
    constraint alignments_pk primary key (site, level, revision),
    constraint alignments_kind_known check (kind in ('align', 'withdraw'))
);
