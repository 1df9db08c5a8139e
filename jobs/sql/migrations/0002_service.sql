-- 0002_service.sql
-- What a server needs: pausing, deleting with a way back, submitting once under a key, and the points of plots kept
-- ready, so that a page of a large grid is read and not computed. Old experiments are neither paused nor deleted; their
-- points are filled in by the next owner (jobs/points.py). The id of an experiment or a cell that is gone is never given
-- to another: addresses of pages and pictures hold it, and so does the measurer's memory.

drop view standing;

create table experiment_of_2 (
    id           integer primary key autoincrement,
    digest       text not null unique,
    name         text not null,
    created_at   text not null,
    cancelled_at text,
    grid         text not null,
    paused_at    text,
    deleted_at   text
) strict;
insert into experiment_of_2 (id, digest, name, created_at, cancelled_at, grid)
select id, digest, name, created_at, cancelled_at, grid from experiment;
drop table experiment;
alter table experiment_of_2 rename to experiment;
create index experiment_name on experiment (name);

create table cell_of_2 (
    id          integer primary key autoincrement,
    digest      text not null unique,
    state       text not null default 'queued' check (state in ('queued', 'running', 'done', 'failed', 'cancelled')),
    crashes     integer not null default 0 check (crashes >= 0),
    revision    integer not null,
    scene_id    integer not null references scene (id),
    spp         integer not null check (spp > 0),
    pixels      integer not null check (pixels > 0),
    error_class text,
    estimand    text not null,
    error       text,
    spec        text not null
) strict;
insert into cell_of_2 select * from cell;
drop table cell;
alter table cell_of_2 rename to cell;
create index cell_running on cell (id) where state = 'running';
create index cell_revision on cell (revision);

create table submission (
    key           text primary key,
    digest        text not null,
    experiment_id integer not null references experiment (id),
    at            text not null
) strict;

create table point (
    experiment_id integer not null references experiment (id),
    position      integer not null,
    name          text not null,
    version       integer not null,
    n             integer not null check (n > 0),
    mean          real not null,
    error         real,
    conditions    text,
    primary key (experiment_id, position, name)
) strict, without rowid;

create view standing as
select
    wanted.*,
    cell.revision as revision,
    case
        when wanted.had = wanted.replicates then 'done'
        when wanted.open then cell.state
        when cell.state = 'failed' then 'failed'
        when (select paused_at from experiment where id = wanted.experiment_id) is not null then 'paused'
        else 'cancelled'
    end as state
from experiment_cell as wanted join cell on cell.id = wanted.cell_id;
