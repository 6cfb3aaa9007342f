-- The log of each level: what robots uploaded, immutable but for its state.
-- Evidence stands last: opening a level reads the rest of a row without it. No foreign keys: the
-- append has the rows of the level and of the robots under its lock, and nothing is ever deleted.
create table contributions (
    site           text             not null,
    level          text             not null,
    revision       bigint           not null, -- place in the level's log, from 1, without gaps
    contribution   text             not null, -- UUIDv7 made by the robot
    digest         text             not null, -- SHA-256 of the canonical CBOR, lower-case hexadecimal
    robot          text             not null,
    state          text             not null, -- folded, held or reverted; the only column that changes
    observed_at_us bigint           not null, -- microseconds since 1970, the robot's clock
    received_at_us bigint           not null, -- microseconds since 1970, the server's clock
    emulated       bigint           not null, -- 1 if its readings were derived from another sensor's, else 0
    segment_count  bigint           not null,
    cluster_count  bigint           not null,
    tile_count     bigint           not null,
    x_m            double precision not null, -- pose of the robot, metres, level frame
    y_m            double precision not null,
    heading_rad    double precision not null, -- radians, counter-clockwise from x
    features       blob             not null, -- CBOR of the contribution without its evidence
    evidence       blob             not null, -- zstd of the CBOR of its evidence
    constraint contributions_pk primary key (site, level, revision),
    constraint contributions_id_unique unique (site, level, contribution),
    constraint contributions_state_known check (state in ('folded', 'held', 'reverted'))
);

create index contributions_by_robot on contributions (site, level, robot, revision);
