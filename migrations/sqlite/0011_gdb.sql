-- The library of a site: prototypes of which objects of the GDB may be instances. Each change of it is a row.
create table libraries (
    site     text   not null,
    revision bigint not null, -- how often the library has changed, from 1
    author   text   not null, -- public id of the token
    at_us    bigint not null, -- microseconds since 1970, the server's clock
    comment  text   not null, -- in the author's words
    constraint libraries_pk primary key (site, revision)
);

-- What a prototype is from a revision of its library on. Immutable.
create table prototypes (
    site     text   not null,
    name     text   not null,
    revision bigint not null, -- of the library
    content  blob,            -- CBOR; null: there is none of this name any more
    constraint prototypes_pk primary key (site, name, revision)
);

-- Entries of a level's log about its GDB, with revisions from the same row. Immutable.
create table gdb_entries (
    site          text   not null,
    level         text   not null,
    revision      bigint not null, -- place in the level's log; no contribution, act or import has it
    entry         text   not null, -- UUID, made by the server
    kind          text   not null, -- 'edit' or 'publication'
    draft         bigint not null, -- of an edit its own revision; of a publication that of the edit published; 0: the empty model
    library       bigint not null, -- the library's revision then; a publication keeps it
    author        text   not null, -- public id of the token
    at_us         bigint not null, -- microseconds since 1970, the server's clock
    comment       text   not null, -- in the author's words
    put_count     bigint not null, -- objects that it put
    removed_count bigint not null, -- objects that it removed
    object_count  bigint not null, -- objects of the draft after it
    constraint gdb_entries_pk primary key (site, level, revision),
    constraint gdb_entries_id_unique unique (site, level, entry)
);

-- What an object of the GDB is from a revision on. Immutable.
create table gdb_objects (
    site     text   not null,
    level    text   not null,
    object   text   not null, -- UUID, made by whoever drew it
    revision bigint not null, -- of the edit
    content  blob,            -- CBOR; null: it is no more
    constraint gdb_objects_pk primary key (site, level, object, revision)
);
create index gdb_objects_by_revision on gdb_objects (site, level, revision);
