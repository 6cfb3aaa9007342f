-- One floor of a site each. The row's lock is what puts a level's log in order.
create table levels (
    site            text             not null,
    level           text             not null, -- slug, never changed
    name            text             not null, -- for people
    frame           text             not null, -- UUID of the level's frame, never changed
    resolution_m    double precision not null, -- edge of a cell, metres, never changed
    elevation_m     double precision not null, -- height of the floor, metres
    revision        bigint           not null, -- newest revision of the log; the next ones come from here, never from a sequence
    folded_revision bigint           not null, -- revision up to which segments, clusters and tiles are folded
    created_at_us   bigint           not null, -- microseconds since 1970, the server's clock
    constraint levels_pk primary key (site, level),
    constraint levels_site_fk foreign key (site) references sites (site),
    constraint levels_resolution_positive check (resolution_m > 0),
    constraint levels_folded_in_log check (folded_revision >= 0 and folded_revision <= revision)
);
