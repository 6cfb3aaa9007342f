-- Robots of a site. The last pose is written by the append to a log, in its transaction.
create table robots (
    site                text             not null,
    robot               text             not null, -- slug, never changed
    name                text             not null, -- for people
    sensors             text             not null, -- JSON: the sensor profiles, as declared
    state               text             not null, -- active, or held: what it sends is kept out of the map
    reported_revision   bigint,                    -- revision of its level that it runs, as it says
    queue_length        bigint,                    -- contributions that wait in its outbox, as it says
    contributions       bigint           not null, -- in the logs of all levels
    last_level          text,                      -- where the newest of its looks was taken; null before the first
    last_x_m            double precision,          -- metres, level frame
    last_y_m            double precision,          -- metres, level frame
    last_heading_rad    double precision,          -- radians, counter-clockwise from x
    last_covariance     text,                      -- JSON: 3 x 3, of (x, y, heading)
    last_observed_at_us bigint,                    -- microseconds since 1970, the robot's clock
    created_at_us       bigint           not null, -- microseconds since 1970, the server's clock
    constraint robots_pk primary key (site, robot),
    constraint robots_site_fk foreign key (site) references sites (site),
    constraint robots_state_known check (state in ('active', 'held'))
);
