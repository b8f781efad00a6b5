% Solves the forward problem of an exported model from its EIDORS fields alone, by definition: linear
% triangles, complete electrodes whose rim edges have both ends among the electrode's nodes.
%   octave-cli eidors_forward.m IN.mat OUT.mat
1;

function v = solve_forward(fmdl, elem_data)
  n = rows(fmdl.nodes); l = numel(fmdl.electrode);
  a = sparse(n + l, n + l);
  for e = 1:rows(fmdl.elems)
    at = fmdl.elems(e, :);
    inverse = inv([ones(3, 1), fmdl.nodes(at, :)]);
    area = abs(det([ones(3, 1), fmdl.nodes(at, :)])) / 2;
    a(at, at) += elem_data(e) * area * inverse(2:3, :)' * inverse(2:3, :);
  end
  for k = 1:l
    electrode = fmdl.electrode(k);
    for b = fmdl.boundary(all(ismember(fmdl.boundary, electrode.nodes), 2), :)'
      at = [b', n + k];
      length_m = norm(diff(fmdl.nodes(b, :)));
      a(at, at) += length_m / electrode.z_contact / 6 * [2 1 -3; 1 2 -3; -3 -3 6];
    end
  end
  free = setdiff(1:n + l, fmdl.gnd_node);
  v = [];
  for d = 1:numel(fmdl.stimulation)
    stim = fmdl.stimulation(d);
    current = [zeros(n, 1); full(stim.stim_pattern)];
    u = zeros(n + l, 1);
    u(free) = a(free, free) \ current(free);
    v = [v; stim.meas_pattern * u(n + 1:end)];
  end
end

files = argv();
load(files{1});
assert(strcmp(fmdl.type, 'fwd_model') && strcmp(vi.type, 'data') && strcmp(img.type, 'image'));
% what valid_fwd_model asks for
numbers = {'nodes', 'elems', 'gnd_node', 'normalize_measurements', 'boundary'};
words = {'name', 'type', 'solve', 'system_mat', 'jacobian'};
assert(all(cellfun(@(f) isnumeric(fmdl.(f)), numbers)) && all(cellfun(@(f) ischar(fmdl.(f)), words)));
assert(isstruct(fmdl.electrode) && numel(fieldnames(fmdl.stimulation)) == 3);
background = img_bkgnd.elem_data;
vh.meas = solve_forward(fmdl, background);
% the Jacobian's column of one element, and what an image of ours answers by it
step = 1e-4 * background(1); e = 700;
up = background; up(e) += step;
slope = (solve_forward(fmdl, up) - vh.meas) / step;
vi.meas = solve_forward(fmdl, background + img.elem_data(:, 1));
linear = J * img.elem_data(:, 1);
theirs = struct('type', 'image', 'name', 'back', 'elem_data', c2f * ones(columns(c2f), 1), 'fwd_model', fmdl);
save('-v7', files{2}, 'fmdl', 'vh', 'vi', 'slope', 'linear', 'theirs', 'J');
