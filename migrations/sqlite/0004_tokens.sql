-- Bearer tokens. A secret itself is never stored.
create table tokens (
    token         text   not null, -- public identity
    secret_sha256 blob   not null, -- SHA-256 of the secret, 32 bytes
    site          text,            -- the site that it is bound to; null for all
    robot         text,            -- the robot that it speaks for, if any
    scopes        text   not null, -- JSON: what it allows
    created_at_us bigint not null, -- microseconds since 1970, the server's clock
    expires_at_us bigint,          -- microseconds since 1970; null for never
    revoked_at_us bigint,          -- microseconds since 1970; null while it is valid
    constraint tokens_pk primary key (token),
    constraint tokens_site_fk foreign key (site) references sites (site),
    constraint tokens_robot_fk foreign key (site, robot) references robots (site, robot),
    constraint tokens_secret_hashed check (length(secret_sha256) = 32)
);
