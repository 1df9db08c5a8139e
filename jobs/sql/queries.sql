-- Every statement that the program runs, by name. Lists come in as JSON arrays.

-- name: revision
select seq from sqlite_sequence where name = 'event';

-- name: add_event
insert into event (at, what, cell_id, experiment_id) values (:at, :what, :cell_id, :experiment_id);


-- Scenes and experiments -------------------------------------------------------------------------------------------

-- name: add_scene
insert into scene (digest, name, main, builtin) values (:digest, :name, :main, :builtin) on conflict do nothing;

-- name: scenes
select id, digest from scene;

-- name: scene_by_digest
select * from scene where digest = :digest;

-- name: uploaded_scenes
select digest, name, main from scene where builtin = 0 order by id desc;

-- name: experiment_by_digest
select id, deleted_at from experiment where digest = :digest;

-- name: experiment_by_id
select * from experiment where id = :id;

-- name: experiment_by_name
select * from experiment where name = :name and deleted_at is null order by id desc limit 1;

-- name: experiments
select * from experiment where deleted_at is null order by id;

-- name: submission
select digest, experiment_id from submission where key = :key;

-- name: add_submission
insert into submission (key, digest, experiment_id, at) values (:key, :digest, :experiment_id, :at);

-- name: forget_submissions
delete from submission where at < :before;

-- name: add_experiment
insert into experiment (digest, name, created_at, grid) values (:digest, :name, :created_at, :grid);

-- name: add_cell
insert into cell (digest, revision, scene_id, spp, pixels, estimand, spec)
values (:digest, :revision, :scene_id, :spp, :pixels, :estimand, :spec)
on conflict do nothing;

-- name: count_cells
select count(*) from cell;

-- name: cell_id
select id from cell where digest = :digest;

-- name: add_experiment_cell
-- Not open yet: opening all rows at once is much faster than keeping the indexes of open ones row by row.
insert into experiment_cell (
    experiment_id, position, cell_id, role, replicates, had, reference_id, spp_asked, scene, integrator, sampler)
select
    :experiment_id, :position, id, :role, :replicates,
    (select count(*) from replicate where cell_id = cell.id and role = :role and k < :replicates),
    :reference_id, :spp_asked, :scene, :integrator, :sampler
from cell where digest = :digest;

-- name: replicates_had
select cell.digest, replicate.role, count(*) as had
from replicate join cell on cell.id = replicate.cell_id
group by replicate.cell_id, replicate.role;

-- name: rates
select wanted.scene, wanted.integrator, sum(samples) / sum(seconds) as rate
from (
    select cell.id as cell_id, sum(replicate.render_seconds) as seconds, sum(1.0 * cell.spp * cell.pixels) as samples
    from replicate join cell on cell.id = replicate.cell_id
    where replicate.machine = :machine
    group by cell.id
) as timed
join experiment_cell as wanted on wanted.cell_id = timed.cell_id
group by wanted.scene, wanted.integrator
having sum(seconds) > 0;


-- The queue: claiming ----------------------------------------------------------------------------------------------

-- name: next_cell
select cell.id, cell.digest, cell.spec
from experiment_cell as wanted indexed by open_in_order
cross join cell on cell.id = wanted.cell_id
where wanted.open = 1 and cell.state = 'queued'
order by wanted.priority desc, wanted.experiment_id, wanted.position
limit 1;

-- name: next_cell_of_experiment
select cell.id, cell.digest, cell.spec
from experiment_cell as wanted indexed by open_in_experiment
cross join cell on cell.id = wanted.cell_id
where wanted.open = 1 and wanted.experiment_id = :experiment_id and cell.state = 'queued'
order by wanted.position
limit 1;

-- name: wanted_replicates
select role, max(replicates) as replicates
from experiment_cell
where cell_id = :cell_id and open = 1 and (:experiment_id is null or experiment_id = :experiment_id)
group by role order by role;

-- name: had_replicates
select role, k from replicate where cell_id = :cell_id;

-- name: is_wanted
select exists (select 1 from experiment_cell where cell_id = :cell_id and open = 1);


-- The queue: changes of state --------------------------------------------------------------------------------------

-- name: cell_state
select state, crashes from cell where id = :cell_id;

-- name: set_state
update cell set state = :state, revision = :revision where id = :cell_id;

-- name: set_crashes
update cell set crashes = :crashes where id = :cell_id;

-- name: set_error
update cell set error_class = :error_class, error = :error where id = :cell_id;

-- name: forgive
update cell set crashes = 0, error_class = null, error = null
where id in (select value from json_each(:cells)) and state = 'failed';

-- name: touch
update cell set revision = :revision where id = :cell_id;

-- name: start_attempt
insert into attempt (cell_id, machine, device, started_at) values (:cell_id, :machine, :device, :at);

-- name: end_attempt
update attempt set ended_at = :at, outcome = :outcome, error = :error, log = :log
where id = :attempt_id and ended_at is null;

-- name: end_attempts
update attempt set ended_at = :at, outcome = :outcome
where cell_id in (select value from json_each(:cells)) and ended_at is null;

-- name: running_cells
select id from cell where state = 'running';

-- name: replicate_id
select id from replicate where cell_id = :cell_id and role = :role and k = :k;

-- name: add_replicate
insert into replicate (
    cell_id, role, k, seed, image, render_seconds, compile_seconds, machine, device, threads, neighbours,
    attempt_id, finished_at)
values (
    :cell_id, :role, :k, :seed, :image, :render_seconds, :compile_seconds, :machine, :device, :threads, :neighbours,
    :attempt_id, :at);

-- name: close_cell
update experiment_cell set open = 0 where cell_id = :cell_id and open = 1;


-- The queue: what experiments want ---------------------------------------------------------------------------------

-- name: set_cancelled
update experiment set cancelled_at = :at where id = :experiment_id and (cancelled_at is null) = (:at is not null);

-- name: set_paused
update experiment set paused_at = :at where id = :experiment_id and (paused_at is null) = (:at is not null);

-- name: set_deleted
update experiment set deleted_at = :at where id = :experiment_id and (deleted_at is null) = (:at is not null);

-- name: is_live
select cancelled_at is null and paused_at is null and deleted_at is null from experiment where id = :experiment_id;

-- name: close_experiment
update experiment_cell set open = 0 where experiment_id = :experiment_id and open = 1;

-- name: open_experiment
update experiment_cell set open = 1
where experiment_id = :experiment_id and open = 0 and had < replicates
    and (select state from cell where id = cell_id) <> 'failed';

-- name: open_everywhere
update experiment_cell set open = 1
where open = 0 and had < replicates and cell_id in (select value from json_each(:cells))
    and experiment_id in (
        select id from experiment where cancelled_at is null and paused_at is null and deleted_at is null);

-- name: failed_cells
select distinct cell.id
from experiment_cell as wanted join cell on cell.id = wanted.cell_id
where wanted.experiment_id = :experiment_id and wanted.had < wanted.replicates and cell.state = 'failed';

-- name: move_missing
update cell set state = :target, revision = :revision
where state = :source
    and id in (select cell_id from experiment_cell where experiment_id = :experiment_id and had < replicates);

-- name: unwanted_running
select id from cell
where state = 'running'
    and id in (select cell_id from experiment_cell where experiment_id = :experiment_id and had < replicates)
    and not exists (select 1 from experiment_cell where cell_id = cell.id and open = 1);

-- name: move_unwanted
update cell set state = :target, revision = :revision
where state = :source
    and id in (select cell_id from experiment_cell where experiment_id = :experiment_id and had < replicates)
    and not exists (select 1 from experiment_cell where cell_id = cell.id and open = 1);

-- name: progress
select role, state, count(*) as cells, sum(had) as had, sum(replicates) as wanted
from (select distinct role, cell_id, state, had, replicates from standing where experiment_id = :experiment_id)
group by role, state;

-- name: open_cells
select count(*) from experiment_cell where open = 1;

-- name: experiments_of_cell
-- Those for which it is drawn now.
select experiment_id as id, scene, integrator, sampler from experiment_cell where cell_id = :cell_id and open = 1;

-- name: samples_left
select sum((replicates - had) * 1.0 * spp * pixels)
from (
    select distinct wanted.cell_id, wanted.role, wanted.replicates, wanted.had, cell.spp, cell.pixels
    from experiment_cell as wanted join cell on cell.id = wanted.cell_id
    where wanted.experiment_id = :experiment_id and wanted.open = 1);

-- name: failures
select
    cell.id, cell.digest, wanted.role, wanted.scene, wanted.integrator, wanted.sampler, wanted.spp_asked as spp,
    case when instr(cell.spec, '"sweep":{}') = 0 then cell.spec ->> '$.estimand.sweep' end as sweep,
    cell.error_class, cell.error, (select log from attempt where cell_id = cell.id order by id desc limit 1) as log
from standing as wanted join cell on cell.id = wanted.cell_id
where wanted.experiment_id = :experiment_id and wanted.state = 'failed'
order by wanted.position;


-- Deleting ---------------------------------------------------------------------------------------------------------

-- name: doomed
-- Cells that nobody has but this experiment, deleted ones included: those can come back.
select cell_id as id from experiment_cell as wanted
where experiment_id = :experiment_id
    and not exists (select 1 from experiment_cell where cell_id = wanted.cell_id and experiment_id <> :experiment_id)
group by cell_id;

-- name: deleted_before
select id from experiment where deleted_at < :before order by id;

-- name: images_of_cells
select image from replicate where cell_id in (select value from json_each(:cells));

-- name: logs_of_cells
select log from attempt where log is not null and cell_id in (select value from json_each(:cells));

-- name: purge_metrics
delete from metric
where reference_id in (select value from json_each(:cells))
    or replicate_id in (select id from replicate where cell_id in (select value from json_each(:cells)));

-- name: purge_floors
delete from floor where reference_id in (select value from json_each(:cells));

-- name: purge_replicates
delete from replicate where cell_id in (select value from json_each(:cells));

-- name: purge_attempts
delete from attempt where cell_id in (select value from json_each(:cells));

-- name: purge_events
delete from event
where experiment_id = :experiment_id or cell_id in (select value from json_each(:cells));

-- name: purge_points
delete from point where experiment_id = :experiment_id;

-- name: purge_submissions
delete from submission where experiment_id = :experiment_id;

-- name: purge_wanted
delete from experiment_cell where experiment_id = :experiment_id;

-- name: purge_cells
delete from cell where id in (select value from json_each(:cells));

-- name: purge_experiment
delete from experiment where id = :experiment_id;


-- Points -----------------------------------------------------------------------------------------------------------

-- name: refresh_errors
-- Eight digits of a mean and four of its error: with seventeen, the cells of a large grid take twice as long to send.
insert or replace into point (experiment_id, position, name, version, n, mean, error)
select
    experiment_id, position, name, version, count(*), cast(printf('%.8g', avg(value)) as real),
    case when count(*) > 1 then cast(
        printf('%.4g', sqrt(sum((value - middle) * (value - middle)) / (count(*) - 1) / count(*))) as real) end
from (
    select wanted.experiment_id, wanted.position, metric.name, metric.version, metric.value,
        avg(metric.value) over (partition by wanted.experiment_id, wanted.position, metric.name) as middle
    from json_each(:cells) as given
    cross join experiment_cell as wanted on wanted.cell_id = given.value and wanted.role = 'cell'
    cross join experiment_cell as reference
        on reference.cell_id = wanted.reference_id and reference.experiment_id = wanted.experiment_id
        and reference.role = 'reference'
    cross join replicate
        on replicate.cell_id = wanted.cell_id and replicate.role = 'cell' and replicate.k < wanted.replicates
    cross join metric
        on metric.replicate_id = replicate.id and metric.reference_id = reference.cell_id
        and metric.reference_replicates = reference.replicates and metric.region = '' and metric.value is not null
    join json_each(:versions) as formula on formula.key = metric.name and formula.value = metric.version
    group by wanted.experiment_id, wanted.position, metric.name, metric.replicate_id
)
group by experiment_id, position, name;

-- name: refresh_seconds
insert or replace into point (experiment_id, position, name, version, n, mean, conditions)
select
    wanted.experiment_id, wanted.position, 'render_seconds', 0, count(*),
    cast(printf('%.4g', avg(replicate.render_seconds)) as real),
    group_concat(distinct machine || ', ' || device || ', ' || threads || ' threads, ' || neighbours || ' beside it')
from json_each(:cells) as given
cross join experiment_cell as wanted on wanted.cell_id = given.value
cross join replicate
    on replicate.cell_id = wanted.cell_id and replicate.role = wanted.role and replicate.k < wanted.replicates
group by wanted.experiment_id, wanted.position;

-- name: without_points
select id from experiment
where exists (select 1 from experiment_cell where experiment_id = experiment.id and had > 0)
    and not exists (select 1 from point where experiment_id = experiment.id);

-- name: cells_of_experiment
select distinct cell_id from experiment_cell where experiment_id = :experiment_id and had > 0;

-- name: measured_names
select distinct name from point where experiment_id = :experiment_id;

-- name: points
-- One row per cell and metric, in the order of the plan, with the mean time where it is known.
select
    wanted.position, wanted.cell_id as cell, wanted.reference_id as reference,
    wanted.scene, wanted.integrator, wanted.sampler, wanted.spp_asked as spp, cell.spp as spp_actual, case when instr(cell.spec, '"sweep":{}') = 0 then cell.spec ->> '$.estimand.sweep' end as sweep,
    point.name, point.n, point.mean, point.error, seconds.mean as seconds, seconds.conditions
from experiment_cell as wanted
cross join cell on cell.id = wanted.cell_id
cross join json_each(:versions) as formula
cross join point
    on point.experiment_id = wanted.experiment_id and point.position = wanted.position and point.name = formula.key
    and point.version = formula.value
left join point as seconds
    on seconds.experiment_id = wanted.experiment_id and seconds.position = wanted.position
    and seconds.name = 'render_seconds'
where wanted.experiment_id = :experiment_id and wanted.role = 'cell' and (:scene is null or wanted.scene = :scene)
order by wanted.position;


-- Cells as an experiment sees them ---------------------------------------------------------------------------------

-- name: cells_page
select
    wanted.position, wanted.cell_id as cell, wanted.role, wanted.scene, wanted.integrator, wanted.sampler,
    wanted.spp_asked as spp, cell.spp as spp_actual, case when instr(cell.spec, '"sweep":{}') = 0 then cell.spec ->> '$.estimand.sweep' end as sweep,
    wanted.state, wanted.had, wanted.replicates as wanted, wanted.reference_id as reference,
    cell.error_class, cell.error,
    (select json_group_array(json_array(name, version, mean, error, n)) from point
     where experiment_id = wanted.experiment_id and position = wanted.position) as points
from standing as wanted join cell on cell.id = wanted.cell_id
where wanted.experiment_id = :experiment_id and wanted.position >= :start
order by wanted.position limit :limit;

-- name: cells_changed
select
    wanted.position, wanted.cell_id as cell, wanted.role, wanted.scene, wanted.integrator, wanted.sampler,
    wanted.spp_asked as spp, cell.spp as spp_actual, case when instr(cell.spec, '"sweep":{}') = 0 then cell.spec ->> '$.estimand.sweep' end as sweep,
    wanted.state, wanted.had, wanted.replicates as wanted, wanted.reference_id as reference,
    cell.error_class, cell.error,
    (select json_group_array(json_array(name, version, mean, error, n)) from point
     where experiment_id = wanted.experiment_id and position = wanted.position) as points
from cell indexed by cell_revision
cross join standing as wanted on wanted.cell_id = cell.id
where cell.revision > :after and wanted.experiment_id = :experiment_id and wanted.position >= :start
order by wanted.position limit :limit;

-- name: experiment_touched
select exists (select 1 from event where revision > :after and experiment_id = :experiment_id);

-- name: standing_touched
select exists (select 1 from event where revision > :after and experiment_id = :experiment_id)
    or exists (
        select 1 from cell indexed by cell_revision cross join experiment_cell as wanted on wanted.cell_id = cell.id
        where cell.revision > :after and wanted.experiment_id = :experiment_id);

-- name: cell_by_id
select cell.*, scene.name as scene_name from cell join scene on scene.id = cell.scene_id where cell.id = :id;

-- name: attempts
select id, started_at, ended_at, machine, device, outcome, error, log from attempt where cell_id = :cell_id order by id;

-- name: images
select k, image from replicate where cell_id = :cell_id and role = :role order by k;

-- name: files_of_experiment
-- One row per cell and file, in the order of the plan: the first picture of a cell, all that make up a reference.
select wanted.position, cell.digest, replicate.image
from experiment_cell as wanted
join cell on cell.id = wanted.cell_id
left join replicate
    on replicate.cell_id = wanted.cell_id and replicate.role = wanted.role
    and replicate.k < case wanted.role when 'reference' then wanted.replicates else 1 end
where wanted.experiment_id = :experiment_id
order by wanted.position, replicate.k;

-- name: made_on
-- The conditions under which an experiment's pictures were made, with the first and the last picture of each.
select distinct
    machine, device, threads, neighbours, count(*) over alike as pictures,
    sum(render_seconds) over alike as render_seconds, sum(compile_seconds) over alike as compile_seconds,
    min(finished_at) over alike as first_at, max(finished_at) over alike as last_at,
    first_value(image) over (alike order by finished_at, id) as first_image,
    first_value(image) over (alike order by finished_at desc, id desc) as last_image
from replicate
where id in (
    select replicate.id
    from experiment_cell as wanted
    join replicate
        on replicate.cell_id = wanted.cell_id and replicate.role = wanted.role and replicate.k < wanted.replicates
    where wanted.experiment_id = :experiment_id)
window alike as (partition by machine, device, threads, neighbours)
order by first_at;



-- Results ----------------------------------------------------------------------------------------------------------

-- name: sweep_parameters
select distinct sweep.key as name
from (
    select min(cell.spec) as spec
    from experiment_cell as wanted join cell on cell.id = wanted.cell_id
    where wanted.experiment_id = :experiment_id and wanted.role = 'cell'
    group by cell.estimand
) as estimand, json_each(estimand.spec, '$.estimand.sweep') as sweep
order by sweep.key;

-- name: results
with recursive count (k) as (
    select 0 union all
    select k + 1 from count
    where k + 1 < (select max(replicates) from experiment_cell where experiment_id = :experiment_id and role = 'cell')
)
select
    experiment.name as experiment, wanted.scene, wanted.integrator, wanted.sampler, wanted.spp_asked as spp,
    cell.spp as spp_actual, count.k as replicate, case when instr(cell.spec, '"sweep":{}') = 0 then cell.spec ->> '$.estimand.sweep' end as sweep,
    replicate.id as replicate_id, replicate.render_seconds, replicate.compile_seconds,
    case when replicate.id is null then wanted.state else 'done' end as state
from standing as wanted
join experiment on experiment.id = wanted.experiment_id
join cell on cell.id = wanted.cell_id
join count on count.k < wanted.replicates
left join replicate on replicate.cell_id = wanted.cell_id and replicate.role = 'cell' and replicate.k = count.k
where wanted.experiment_id = :experiment_id and wanted.role = 'cell'
order by wanted.position, count.k;

-- name: metrics
select distinct metric.replicate_id, metric.name, metric.value
from experiment_cell as wanted
join experiment_cell as reference
    on reference.cell_id = wanted.reference_id and reference.experiment_id = wanted.experiment_id
    and reference.role = 'reference'
join replicate
    on replicate.cell_id = wanted.cell_id and replicate.role = 'cell' and replicate.k < wanted.replicates
join metric
    on metric.replicate_id = replicate.id and metric.reference_id = reference.cell_id
    and metric.reference_replicates = reference.replicates and metric.region = ''
join json_each(:versions) as formula on formula.key = metric.name and formula.value = metric.version
where wanted.experiment_id = :experiment_id and wanted.role = 'cell';


-- Measuring --------------------------------------------------------------------------------------------------------

-- name: reference_ids
select distinct reference_id from experiment_cell where reference_id is not null order by reference_id;

-- name: references_of_experiment
select distinct reference_id from experiment_cell
where experiment_id = :experiment_id and reference_id is not null order by reference_id;

-- name: cells_of_reference
select distinct cell_id from experiment_cell
where reference_id = :reference_id and cell_id > :after
order by cell_id limit :limit;

-- name: gaps_of_cells
select distinct replicate_id, cell_id, image, reference_id, reference_replicates
from json_each(:cells) as given cross join pair on pair.cell_id = given.value
where pair.reference_id = :reference_id and exists (
    select 1 from json_each(:versions) as formula
    where not exists (
        select 1 from metric
        where metric.replicate_id = pair.replicate_id and metric.reference_id = pair.reference_id
            and metric.reference_replicates = pair.reference_replicates
            and metric.name = formula.key and metric.version = formula.value and metric.region = ''))
order by replicate_id, reference_replicates;

-- name: replicate_by_id
select id, cell_id, role, k, image from replicate where id = :id;

-- name: pairs_of_replicate
select distinct replicate_id, cell_id, image, reference_id, reference_replicates
from pair where replicate_id = :replicate_id;

-- name: completes_reference
select exists (
    select 1 from experiment_cell
    where cell_id = :cell_id and role = 'reference' and had = replicates and replicates > :k);

-- name: reference_images
select image from replicate where cell_id = :cell_id and role = 'reference' and k < :replicates order by k;

-- name: without_floors
-- Of these cells, the complete references with halves, whose floor is not known by the current formulas.
select distinct wanted.cell_id as reference_id, wanted.replicates as reference_replicates
from json_each(:cells) as given cross join experiment_cell as wanted on wanted.cell_id = given.value
where wanted.role = 'reference' and wanted.had = wanted.replicates and wanted.replicates > 1 and exists (
    select 1 from json_each(:versions) as formula
    where not exists (
        select 1 from floor
        where floor.reference_id = wanted.cell_id and floor.reference_replicates = wanted.replicates
            and floor.name = formula.key and floor.version = formula.value))
order by reference_id, reference_replicates;

-- name: add_floor
insert or replace into floor (reference_id, reference_replicates, name, version, value)
values (:reference_id, :reference_replicates, :name, :version, :value);

-- name: floors_of_experiment
select floor.reference_id as reference, floor.value
from experiment_cell as wanted
join floor on floor.reference_id = wanted.cell_id and floor.reference_replicates = wanted.replicates
where wanted.experiment_id = :experiment_id and wanted.role = 'reference' and floor.name = :name
    and floor.version = :version;

-- name: add_metric
insert or replace into metric (replicate_id, reference_id, reference_replicates, name, version, value, reason)
values (:replicate_id, :reference_id, :reference_replicates, :name, :version, :value, :reason);
