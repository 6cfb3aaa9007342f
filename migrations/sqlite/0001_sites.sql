-- Plants or buildings: the unit of tenancy and permissions.
create table sites (
    site          text   not null, -- slug, chosen by people, never changed
    name          text   not null, -- for people
    created_at_us bigint not null, -- microseconds since 1970, the server's clock
    constraint sites_pk primary key (site)
);
