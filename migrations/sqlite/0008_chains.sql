-- Chains of the folded map, as segments and clusters. A map that was written before they were kept
-- is found to lack them when its level is opened, and is folded again.
create table chains (
    site     text   not null,
    level    text   not null,
    feature  text   not null, -- <segment>.<piece> that it is called after
    revision bigint not null, -- of its last change
    content  blob,            -- CBOR as published; null if it is no more
    constraint chains_pk primary key (site, level, feature)
);
