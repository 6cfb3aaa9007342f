-- Changes that robots found against the GDB, and that operators do not want to be told of any more.
create table dismissals (
    site    text   not null,
    level   text   not null,
    change  text   not null, -- its identity: kind and object, or kind and founding feature
    author  text   not null, -- public id of the token
    at_us   bigint not null, -- microseconds since 1970, the server's clock
    comment text   not null, -- in the author's words
    constraint dismissals_pk primary key (site, level, change)
);
