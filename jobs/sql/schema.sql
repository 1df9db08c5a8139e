-- What a fresh database holds. A database of an older version reaches the same through migrations/, and a test
-- proves it: change both together. Times are UTC, ISO 8601. Large columns stand last, so that reading a state
-- does not load a specification.

-- A scene's snapshot: its files lie in scenes/<digest>/.
create table scene (
    id      integer primary key,
    digest  text not null unique,
    name    text not null,                               -- as the first grid that used it wrote it
    main    text not null,                               -- the XML file to load, relative to its folder
    builtin integer not null check (builtin in (0, 1))
) strict;

-- One cell: what is rendered, whoever wants it. Only jobs/queue.py changes a state.
create table cell (
    id          integer primary key autoincrement,       -- never given again: addresses of pictures hold it
    digest      text not null unique,
    state       text not null default 'queued' check (state in ('queued', 'running', 'done', 'failed', 'cancelled')),
    crashes     integer not null default 0 check (crashes >= 0), -- of its render process since its last replicate
    revision    integer not null,                        -- of the last event that concerns it
    scene_id    integer not null references scene (id),
    spp         integer not null check (spp > 0),        -- rendered, after the sampler's rounding
    pixels      integer not null check (pixels > 0),     -- rendered: of the crop where there is one
    error_class text,
    estimand    text not null,                           -- digest: only cells with equal estimands are compared
    error       text,
    spec        text not null                            -- canonical JSON, see renderer/spec.py
) strict;
create index cell_running on cell (id) where state = 'running';
create index cell_revision on cell (revision);

-- One grid that somebody asked for.
create table experiment (
    id           integer primary key autoincrement,      -- never given again: addresses of pages hold it
    digest       text not null unique,
    name         text not null,
    created_at   text not null,
    cancelled_at text,                                   -- null: not cancelled
    grid         text not null,                          -- canonical JSON, see jobs/gridspec.py
    paused_at    text,                                   -- null: not paused
    deleted_at   text                                    -- null: there; else it is gone for good some minutes later
) strict;
create index experiment_name on experiment (name);

-- What an experiment wants of a cell, in the order of its plan, and how people read it there.
create table experiment_cell (
    experiment_id integer not null references experiment (id),
    position      integer not null,
    cell_id       integer not null references cell (id),
    role          text not null check (role in ('cell', 'reference')),
    replicates    integer not null check (replicates > 0),   -- wanted: k = 0 … replicates − 1
    had           integer not null default 0 check (had between 0 and replicates), -- of these, rendered
    open          integer not null default 0 check (open in (0, 1)), -- 1: live, not failed, and some are missing
    priority      integer not null default 0,            -- larger runs first
    reference_id  integer references cell (id),          -- the cell whose pictures this one is measured against
    spp_asked     integer not null,
    scene         text not null,
    integrator    text not null,
    sampler       text not null,
    primary key (experiment_id, position)
) strict, without rowid;
-- The queue itself: claiming reads its first rows, however many cells are done.
create index open_in_order on experiment_cell (priority desc, experiment_id, position) where open = 1;
create index open_in_experiment on experiment_cell (experiment_id, position) where open = 1;
create index experiment_cell_by_cell on experiment_cell (cell_id);
create index experiment_cell_by_reference on experiment_cell (reference_id, cell_id) where reference_id is not null;

-- One try at a cell; history, never rewritten once it ended.
create table attempt (
    id         integer primary key,
    cell_id    integer not null references cell (id),
    machine    text not null,
    device     text not null,
    started_at text not null,
    ended_at   text,
    outcome    text,                                     -- done, released, cancelled, owner_lost or an error class
    error      text,
    log        text,                                     -- file, relative to the data directory
    check ((ended_at is null) = (outcome is null))
) strict;
create index attempt_by_cell on attempt (cell_id);
create unique index attempt_open on attempt (cell_id) where ended_at is null;

-- One finished picture. Its file is on disk before its row is here.
create table replicate (
    id              integer primary key,
    cell_id         integer not null references cell (id),
    role            text not null check (role in ('cell', 'reference')),
    k               integer not null check (k >= 0),
    seed            integer not null,
    image           text not null,                       -- file, relative to the data directory
    render_seconds  real not null,
    compile_seconds real not null,
    machine         text not null,
    device          text not null,
    threads         integer not null,
    neighbours      integer not null,                    -- renders that ran beside it on the machine
    attempt_id      integer not null references attempt (id),
    finished_at     text not null,
    unique (cell_id, role, k)
) strict;

create trigger replicate_counted after insert on replicate begin
    update experiment_cell
    set had = had + 1, open = open and had + 1 < replicates
    where cell_id = new.cell_id and role = new.role and new.k < replicates;
end;

-- One number: a replicate against the first reference_replicates pictures of a reference cell.
create table metric (
    replicate_id         integer not null references replicate (id),
    reference_id         integer not null references cell (id),
    reference_replicates integer not null check (reference_replicates > 0),
    name                 text not null,
    version              integer not null,               -- of the formula
    region               text not null default '',       -- '': the whole picture
    value                real,
    reason               text,                           -- why there is no value
    primary key (replicate_id, reference_id, reference_replicates, name, version, region),
    check ((value is null) = (reason is not null))
) strict, without rowid;

-- A request that a client may send again: the same key and body is the same submission.
create table submission (
    key           text primary key,
    digest        text not null,                         -- of the grid
    experiment_id integer not null references experiment (id),
    at            text not null
) strict;

-- One point of a plot, kept ready by jobs/points.py: a metric, or render_seconds, over the replicates that an
-- experiment wants of a cell. Derived: every row can be computed again from metric and replicate.
create table point (
    experiment_id integer not null references experiment (id),
    position      integer not null,
    name          text not null,
    version       integer not null,                      -- of the formula; 0 for render_seconds
    n             integer not null check (n > 0),
    mean          real not null,
    error         real,                                  -- standard error of the mean; null for n = 1
    conditions    text,                                  -- of render_seconds: machine, device, threads, neighbours
    primary key (experiment_id, position, name)
) strict, without rowid;

-- What an exact picture would measure: the part of a metric that is the reference's own noise.
create table floor (
    reference_id         integer not null references cell (id),
    reference_replicates integer not null check (reference_replicates > 0),
    name                 text not null,
    version              integer not null,               -- of the formula
    value                real not null check (value >= 0),
    primary key (reference_id, reference_replicates, name)
) strict, without rowid;

-- What happened, in order; its last revision is the store's.
create table event (
    revision      integer primary key autoincrement,
    at            text not null,
    what          text not null,                         -- a move of jobs/queue.py, 'submit' or 'measure'
    cell_id       integer references cell (id),
    experiment_id integer references experiment (id)
) strict;

-- A cell as one experiment sees it: done once the experiment has what it wants, even while others want more.
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

-- A replicate and a reference that an experiment measures it against, complete as that experiment wants it.
create view pair as
select
    replicate.id as replicate_id, replicate.cell_id as cell_id, replicate.image as image,
    wanted.reference_id as reference_id, reference.replicates as reference_replicates
from replicate
join experiment_cell as wanted
    on wanted.cell_id = replicate.cell_id and wanted.role = 'cell' and replicate.k < wanted.replicates
join experiment_cell as reference
    on reference.cell_id = wanted.reference_id and reference.experiment_id = wanted.experiment_id
    and reference.role = 'reference' and reference.had = reference.replicates
where replicate.role = 'cell';
