-- 0003_floor.sql
-- What the noise of a reference alone adds to a metric, so that a plot can show where its curves stop to mean anything.
-- References of older databases get theirs from the next owner.

create table floor (
    reference_id         integer not null references cell (id),
    reference_replicates integer not null check (reference_replicates > 0),
    name                 text not null,
    version              integer not null,
    value                real not null check (value >= 0),
    primary key (reference_id, reference_replicates, name)
) strict, without rowid;
