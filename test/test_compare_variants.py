# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The tool ``compare_variants``: its page, the paper's claims on short runs, and bad input."""

from base64 import b64encode
from html.parser import HTMLParser
import os

import numpy as np
import pytest

from dm_ros import VARIANTS
from dm_ros.mechanism.parameters import SelfLockingParameters, SymmetricParameters
from dm_ros.mechanism.self_locking import balance, SelfLockingDae, SelfLockingOde
from dm_ros.mechanism.symmetric import SymmetricDae
from dm_ros.mechanism.variants import CATALOGUE, MECHANISMS, SELF_LOCKING, SYMMETRIC, variants_of
from dm_ros.tools import compare_variants
from dm_ros.tools.comparison import laws, measures
from dm_ros.tools.comparison import page as comparison_page
from dm_ros.tools.comparison.claims import SILENT
from dm_ros.tools.comparison.figures import FIGURES
from dm_ros.tools.comparison.reference import exact_self_locking, exact_symmetric
from dm_ros.tools.comparison.runs import Load, RATES, run, ticks_of


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """Run each test in a folder of its own."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(scope='module')
def runs():
    """Return the runs of both mechanisms over a short piece of the built-in loads."""
    class ToSlipAndLock(Load):
        """The piece of Figure 7 in which the clutches let go, the direction changes, both lock."""

        def held(self, rate):
            start = round(1.2 * rate)
            return Load(self.mechanism, 1.2 + self.seconds).held(rate)[start:]

    return {SYMMETRIC: run(SYMMETRIC, Load(SYMMETRIC, 0.6), {}, lambda n=1: None),
            SELF_LOCKING: run(SELF_LOCKING, ToSlipAndLock(SELF_LOCKING, 1.1), {},
                              lambda n=1: None)}


class Page(HTMLParser):
    """What a page refers to and which elements are left open."""

    VOID = {'meta', 'img', 'link', 'br'}

    def __init__(self, text):
        super().__init__()
        self.images, self.links, self.open, self.text = {}, [], [], ''
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        if tag not in self.VOID:
            self.open.append(tag)
        if tag == 'img':
            self.images[attributes['alt']] = attributes['src']
        if tag == 'a':
            self.links.append(attributes['href'])

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data


def compare(*arguments):
    return compare_variants.main(['--duration', '0.1', *arguments])


def page_in(path, name='index.html'):
    with open(os.path.join(path, name), encoding='utf-8') as file:
        return file.read()


def test_page_is_complete_and_shows_every_picture_that_lies_beside_it(capsys):
    assert compare() == 0
    assert 'index.html' in capsys.readouterr().out
    laws_figures = {'laws-symmetric.png', 'laws-lsd.png'}
    assert set(os.listdir('comparison')) == {*FIGURES, *laws_figures, 'index.html', 'laws.html'}
    page, laws_page = Page(page_in('comparison')), Page(page_in('comparison', 'laws.html'))
    assert page.open == [] == laws_page.open
    assert set(page.images) == set(FIGURES) and set(laws_page.images) == laws_figures
    assert 'laws.html' in page.links and 'index.html' in laws_page.links
    for one in (page, laws_page):
        for name, source in one.images.items():
            with open(os.path.join('comparison', name), 'rb') as file:
                content = file.read()
            assert content.startswith(b'\x89PNG') and content.endswith(b'IEND\xaeB\x60\x82')
            assert source == 'data:image/png;base64,' + b64encode(content).decode()
            assert name in one.links
    for words in (*VARIANTS, 'What the paper says', 'Difference to the exact solution',
                  'µs a step', '10,000 Hz', 'the defaults', *comparison_page.TITLES.values()):
        assert words in page.text


def test_all_but_the_timings_is_the_same_in_each_run(monkeypatch):
    monkeypatch.setattr('dm_ros.tools.comparison.runs.perf_counter', iter(range(10**6)).__next__)
    for out in 'ab':
        assert compare('--mechanism', 'symmetric', '--out', out) == 0
    assert page_in('a') == page_in('b')
    assert page_in('a', 'laws.html') == page_in('b', 'laws.html')


def test_own_load_and_parameters_are_taken_and_named():
    with open('IN.csv', 'w') as file:
        file.write('time,carrier,rear,front\n0,300,-200,-50\n0.2,-300,150,100\n9,0,0,0\n')
    with open('own.yaml', 'w') as file:
        file.write('/**:\n  ros__parameters:\n    lsd.clutch.rear.preload: 50.0\n')
    assert compare('--mechanism', 'lsd', '--torques', 'IN.csv', '--params', 'own.yaml') == 0
    page = Page(page_in('comparison'))
    for words in ('IN.csv, the first 0.1 of 9 s', 'own.yaml', 'lsd.clutch.rear.preload 50'):
        assert words in page.text
    assert set(page.images) == {name for name, row in FIGURES.items() if row[0] is SELF_LOCKING}
    assert 'symmetric_ode' not in page.text


def test_a_log_is_taken_from_its_begin_and_what_it_loses_is_told(tmp_path, capsys):
    file = tmp_path / 'log.csv'
    file.write_text('time,gear,pinion,left,right\n' + ''.join(
        f'{1748873654 + n / 1000:.3f},D,{n},-1,-1\n' for n in range(101)))
    chosen, _ = compare_variants.loads(compare_variants.parser().parse_args(
        ['--mechanism', 'symmetric', '--torques', str(file), '--ignore-columns', 'gear']))
    load, = chosen.values()
    assert load.seconds == 0.1 and [row[0] for row in load.held(1000)] == list(range(100))
    begin, lost = capsys.readouterr().err.splitlines()
    assert begin.startswith(f'compare_variants: {file}: time 0 is 1748873654.0 s in the file')
    assert lost == (f'compare_variants: {file}: 90 of 101 rows are never in force in ticks of '
                    '0.01 s')


def test_a_load_at_rest_makes_a_page_without_a_warning(recwarn):
    with open('IN.csv', 'w') as file:
        file.write('time,carrier,rear,front\n0,0,0,0\n1,0,0,0\n')
    assert compare('--mechanism', 'lsd', '--torques', 'IN.csv') == 0
    assert 'load does not show it' in page_in('comparison')
    assert not [str(w.message) for w in recwarn if 'dm_ros' in str(w.filename)]


BAD = {
    'unknown column': (['--mechanism', 'lsd', '--torques', 'bad.csv'], 'bad.csv:1:'),
    'no such load': (['--mechanism', 'lsd', '--torques', 'none.csv'], 'none.csv'),
    'load of which mechanism': (['--torques', 'bad.csv'], '--mechanism'),
    'no such parameters': (['--params', 'none.yaml'], 'none.yaml'),
    'unknown parameter': (['--params', 'bad.yaml'], 'bad.yaml: lsd.colour'),
    'negative duration': (['--duration', '-1'], 'duration'),
    'no duration': (['--duration', 'nan'], 'duration'),
    'too short': (['--duration', '0.01'], 'duration'),
    'torques beyond all numbers': (['--mechanism', 'lsd', '--torques', 'huge.csv'], 'huge.csv'),
    'out is a file': (['--out', 'bad.csv'], 'bad.csv'),
}


@pytest.mark.parametrize('name', BAD)
def test_bad_input_ends_with_one_line_and_leaves_nothing(name, capsys):
    with open('bad.csv', 'w') as file:
        file.write('time,pinion\n0,1\n')
    with open('huge.csv', 'w') as file:
        file.write('time,carrier,front,rear\n0,1e308,1e308,1e308\n1,0,0,0\n')
    with open('bad.yaml', 'w') as file:
        file.write('/**:\n  ros__parameters:\n    lsd.colour: red\n')
    before = sorted(os.listdir())
    arguments, words = BAD[name]
    assert compare(*arguments) == 2
    out, err = capsys.readouterr()
    assert out == '' and err.count('\n') == 1 and words in err
    assert err.startswith('compare_variants: error: ')
    assert sorted(os.listdir()) == before


def test_a_failed_run_leaves_the_page_before_as_it_is():
    os.mkdir('comparison')
    with open('comparison/index.html', 'w') as file:
        file.write('before')
    assert compare('--params', 'none.yaml') == 2
    assert page_in('comparison') == 'before'


def test_the_progress_bar_ends_where_it_said():
    for mechanism in MECHANISMS.values():
        load, done = Load(mechanism, 0.05), []
        run(mechanism, load, {}, lambda n=1, done=done: done.append(n))
        assert sum(done) == ticks_of(mechanism, load)


@pytest.fixture(scope='module')
def outcomes():
    """Return both laws on all cases of both mechanisms, the first three seconds of each."""
    return {m: laws.run(m, Load(m, 3.0), {}, lambda n: None, 3.0) for m in MECHANISMS.values()}


@pytest.mark.parametrize('mechanism', MECHANISMS.values(), ids=MECHANISMS)
def test_the_energies_of_both_laws_add_up_and_only_the_paper_gives_back(outcomes, mechanism):
    for name, pair in outcomes[mechanism].items():
        assert [outcome.law for outcome in pair] == ['passive', 'paper']
        for outcome in pair:
            net = outcome.energy_in - outcome.energy_out
            assert net == pytest.approx(outcome.work.sum(), abs=1e-9 * outcome.energy_in)
            gears_and_bearings = [outcome.lost[n] for n in mechanism.gears + mechanism.bearings]
            given = -np.minimum(gears_and_bearings, 0.0).sum(axis=0)
            assert outcome.returned == pytest.approx(given)
        passive, paper = pair
        assert not passive.returned.any()
        assert min(map(np.min, passive.lost.values())) >= 0.0
        if name in ('cruise', 'weight', 'rest', 'power', 'held'):
            assert paper.returned.sum() > 0.0, name



def test_the_cases_show_what_the_laws_differ_in(outcomes):
    for mechanism in MECHANISMS.values():
        case = outcomes[mechanism]
        for name in ('ramp', 'ripple', 'power', 'held', 'cruise', 'rest', 'weight'):
            assert case[name][0].switches <= 1, name
        assert min(case['held'][1].switches, case['power'][1].switches) > 1000
        passive, paper = case['rest']
        assert not passive.carrier.any() and abs(paper.carrier[-1]) > 100.0
        passive, paper = case['cruise']   # out over in
        assert passive.energy_out < passive.energy_in and paper.energy_out > paper.energy_in
        passive, paper = case['weight']   # lowered by a creep, lifted by its losses
        assert 0.0 < passive.carrier[-1] < 2 * 0.02 and paper.carrier[-1] < -0.5


def test_sizes_in_the_table_are_those_of_the_equations():
    p, q = SymmetricParameters(), SelfLockingParameters()
    sizes = {'symmetric_ode': 2, 'symmetric_dae': len(SymmetricDae(p).system(1)[0]),
             'lsd_lagged': len(balance(q, -1)[0]), 'lsd_ode': len(SelfLockingOde(q).system(1)[0]),
             'lsd_dae': len(SelfLockingDae(q).system(1)[0])}
    assert {name: len(v.unknowns.split()) for name, v in CATALOGUE.items()} == sizes
    assert comparison_page.GIVEN.keys() == sizes.keys()


def test_exact_solution_of_the_symmetric_one_does_not_depend_on_the_tick():
    p, torques = SymmetricParameters(), (20.0, -30.0, -35.0)
    once, often = (exact_symmetric(p, [torques] * n, 0.1 / n, (50.0, 60.0)) for n in (1, 64))
    assert np.allclose(once.speed[-1], often.speed[-1], rtol=1e-14)
    assert np.allclose(once.moment[-1], often.moment[-1], rtol=1e-13)


def test_exact_solution_of_the_self_locking_one_does_not_depend_on_the_tick():
    p, torques = SelfLockingParameters(), (300.0, -50.0, -200.0)
    once, often = (exact_self_locking(p, [torques] * n, 0.1 / n, (50.0, 60.0)) for n in (1, 64))
    assert np.allclose(once.speed[-1], often.speed[-1], rtol=1e-9)
    assert np.allclose(once.moment[-1], often.moment[-1], rtol=1e-7)


def test_symmetric_variants_are_identical_and_switch_together(runs):
    for rate in RATES:
        ode, dae = (runs[SYMMETRIC].records[v, rate] for v in variants_of(SYMMETRIC))
        assert np.abs(measures.three_speeds(ode) - measures.three_speeds(dae)).max() < 1e-9
        assert (ode.power_flow == dae.power_flow).all()


def test_variants_2_and_3_are_the_exact_solution_at_every_rate(runs):
    lsd = runs[SELF_LOCKING]
    for variant in ('lsd_ode', 'lsd_dae'):
        for rate in RATES:
            d = measures.difference(lsd.records[variant, rate], lsd.exact[rate])
            assert d.speed < 2e-3 and d.other_index == 0
    ode, dae = (lsd.records[v, 1000] for v in ('lsd_ode', 'lsd_dae'))
    assert np.abs(measures.three_speeds(ode) - measures.three_speeds(dae)).max() < 1e-9


def test_error_of_the_lagged_variant_falls_with_the_step_and_it_meets_its_own_yardstick(runs):
    errors = []
    for rate in RATES:
        record = runs[SELF_LOCKING].records['lsd_lagged', rate]
        errors.append(measures.difference(record, runs[SELF_LOCKING].exact[rate]).speed_rms)
        assert measures.difference(record, runs[SELF_LOCKING].frozen[rate]).speed < 1e-3
    assert errors[0] > 5 * errors[1] > 25 * errors[2]


def test_lagged_moments_lag_by_a_tick_or_more_in_sliding_while_speeds_are_good(runs):
    record, exact = runs[SELF_LOCKING].records['lsd_lagged', 1000], runs[SELF_LOCKING].exact[1000]
    lag = measures.lags(record, exact, 1000)
    front_mesh, rear_mesh, front_clutch, rear_clutch = lag
    assert abs(front_mesh) < 0.3 and 0.5 < rear_mesh < 1.0
    assert 0.9 < front_clutch < 1.3 and 1.3 < rear_clutch < 2.0
    assert measures.difference(record, exact).relative_speed < 1e-3
    ode = measures.lags(runs[SELF_LOCKING].records['lsd_ode', 1000], exact, 1000)
    assert np.abs(ode).max() < 0.01


def test_the_lag_of_a_shifted_signal_is_found():
    class Shifted:
        power_flow = np.ones(400)
        moment = {'mesh': np.sin((np.arange(400) - 1.6) / 20)}
        slip = np.full(400, 50.0)

    class Exact:
        power_flow = np.ones(400)
        speed = np.array([[0.0, 50.0, 0.0]] * 400)
        moment = np.sin(np.arange(400)[:, None] / 20)

    assert measures.lags(Shifted(), Exact(), 1000) == pytest.approx([1.6], abs=1e-2)


def test_gear_moments_are_near_40_to_60(runs):
    shares, _ = measures.gear_share(runs[SELF_LOCKING].records['lsd_ode', 1000])
    assert np.median(shares) == pytest.approx(0.4, abs=0.02)


def test_it_locks_and_without_proportional_friction_the_shafts_run_apart(runs):
    with_, without = runs[SELF_LOCKING].records['lsd_ode', 1000], runs[SELF_LOCKING].without
    locked = np.abs(with_.slip) < measures.LOCKED
    assert measures.longest_stretch(locked) > 20
    assert np.abs(without.moment['rear_clutch']).max() < 32.5   # the preload
    assert np.abs(without.slip).max() > 1.2 * np.abs(with_.slip).max()


def test_every_statement_of_the_paper_gets_a_number_and_a_verdict(runs):
    for mechanism, make in compare_variants.CLAIMS.items():
        for claim in make(runs[mechanism]):
            assert claim.verdict in comparison_page.VERDICT_CLASSES
            assert any(c.isdigit() for c in claim.here) or claim.verdict == SILENT
            assert 'nan' not in claim.here
